#pragma once

#include <cstdint>
#include <vector>

#include <isobrick/progress.h>
#include "filters/filter_stage.h"
#include "filters/open_sides.h"
#include "filters/scratch_array.h"

namespace isobrick::inline v0 {

/// How a mesh is smoothed: MeshFilterOptions.
struct Smoothing {
  int iterations = 0;
  double pass_band = 0.1;
  Progress* progress = nullptr;  ///< null: nobody hears of the iterations
};

/// Passes a smoothed mesh on: Taubin, A signal processing approach to fair surface design, 1995.
///
/// Each iteration moves every vertex towards the mean of its neighbours by the fraction λ, and then
/// away from it by −μ. A frequency k along the surface is multiplied by (1 − λk)(1 − μk), which is
/// 1 at 0 and at the pass band 1/λ + 1/μ, so a surface keeps its size.
///
/// A step is a pass over the triangles, which adds to each corner its differences to the other two.
/// Two triangles share each side, so every neighbour counts twice. Sums are in the order of the
/// triangles, whatever the chunks.
template <class Number>
class SmoothStage final : public FilterStage {
 public:
  SmoothStage(MeshSink& next, std::stop_token cancel, const ScratchPlace& place,
              std::uint64_t memory, const Smoothing& smoothing);

  bool takes_wide() const override { return next().takes_wide(); }
  void begin(const MeshHeader& header) override;
  void write(const MeshChunk& chunk) override;
  void finish() override;

  /// Taubin's λ. His μ follows from it and the pass band.
  static constexpr double kLambda = 0.6307;

 private:
  struct Vertex {
    Vec3f position;
    std::uint32_t differences = 0;  ///< in the sum
    Vec3f sum = {};
    std::uint32_t is_fixed = 0;
  };

  std::uint64_t own_bytes() const override {
    return vertices_.file_bytes() + normals_.file_bytes() + triangles_.file_bytes();
  }
  std::uint64_t own_memory() const override {
    return vertices_.memory() + normals_.memory() + triangles_.memory() + sides_.memory();
  }
  Progress& progress() { return smoothing_.progress ? *smoothing_.progress : no_progress(); }
  void fix_borders();
  void add_differences();
  void move(double fraction);
  void add_normals();
  void write_vertices();

  Smoothing smoothing_;
  bool has_normals_ = false, wide_ = false;  ///< of the header
  ScratchArray<Vertex> vertices_;
  ScratchArray<Vec3f> normals_;
  ScratchArray<TriangleOf<Number>> triangles_;
  OpenSides<Number> sides_;
  std::vector<TriangleOf<Number>> converted_;  ///< of a chunk
};

}  // namespace isobrick
