#pragma once

#include <cmath>
#include <optional>
#include <vector>

#include <isobrick/mesh_filters.h>
#include "filters/filter_stage.h"
#include "filters/open_sides.h"
#include "filters/scratch_array.h"
#include "filters/vertex_sets.h"

namespace isobrick::inline v0 {

/// A sum in double whose rounding errors are summed as well (Neumaier).
class CompensatedSum {
 public:
  void add(double value) {
    const double sum = sum_ + value;
    error_ += std::abs(sum_) >= std::abs(value) ? (sum_ - sum) + value : (value - sum) + sum_;
    sum_ = sum;
  }
  double value() const { return sum_ + error_; }

 private:
  double sum_ = 0, error_ = 0;
};

/// Measures the mesh that it passes on.
template <class Number>
class MeasureStage final : public FilterStage {
 public:
  MeasureStage(MeshSink& next, std::stop_token cancel, const ScratchPlace& place,
               std::uint64_t memory);

  bool takes_wide() const override { return next().takes_wide(); }
  void begin(const MeshHeader& header) override;
  void write(const MeshChunk& chunk) override;
  void finish() override;

  /// After finish().
  const MeshMeasure& measure() const { return measure_; }

 private:
  std::uint64_t own_bytes() const override { return positions_.file_bytes(); }
  std::uint64_t own_memory() const override {
    return positions_.memory() + sets_.memory() + sides_.memory();
  }
  void add(const TriangleOf<Number>& triangle, const MeshChunk& chunk);
  void include(Vec3d position);
  void complete();

  ScratchArray<Vec3f> positions_;
  VertexSets<Number> sets_;
  OpenSides<Number> sides_;
  std::vector<TriangleOf<Number>> converted_;  ///< of a chunk
  MeshMeasure measure_;
  std::optional<Vec3d> origin_;   ///< of volumes: a vertex, so that coordinates are small
  CompensatedSum area_, volume_;  ///< twice, and six times
};

}  // namespace isobrick
