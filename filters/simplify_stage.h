#pragma once

#include <tbb/task_arena.h>

#include <cstdint>
#include <optional>
#include <vector>

#include <isobrick/progress.h>
#include "filters/collapse_spool.h"
#include "filters/filter_stage.h"
#include "filters/mesh_spool.h"
#include "filters/triangle_groups.h"

namespace isobrick::inline v0 {

/// How far a mesh is simplified: MeshFilterOptions.
struct Simplification {
  double ratio = 1;              ///< of the triangles
  std::uint64_t triangles = 0;   ///< in place of the ratio, where it is not 0
  double max_error = 0;          ///< world units; 0: any
  int threads = 0;               ///< 0: all cores
  Progress* progress = nullptr;  ///< null: nobody hears of the groups
  bool measures_error = false;   ///< SimplifyStage::error()
};

/// Passes a simplified mesh on, whatever its size.
///
/// Triangles are sorted into groups of boxes, and the edges of each group collapse by themselves:
/// EdgeCollapse. Of all collapses those of the smallest errors are done, wherever they are.
/// Vertices on the borders of groups stay, so neighbours fit together. Two more passes, with other
/// boxes, simplify what the first ones left along the borders. Kept vertices keep their place,
/// normal and order.
template <class Number>
class SimplifyStage final : public FilterStage {
 public:
  SimplifyStage(MeshSink& next, std::stop_token cancel, const ScratchPlace& place,
                std::uint64_t memory, const Simplification& simplification,
                std::uint64_t max_narrow_vertices = kMaxNarrowVertices);

  /// What is left may be small enough for any sink.
  bool takes_wide() const override { return true; }
  void begin(const MeshHeader& header) override;
  void write(const MeshChunk& chunk) override;
  void finish() override;

  /// Triangles that it aimed at, after finish(); nothing where only the error decides.
  const std::optional<std::uint64_t>& goal() const { return goal_; }
  /// How far the mesh that entered is at most from the mesh that left, after finish(), in world
  /// units: the sum over passes of what their vertices and the centres of their triangles are.
  /// Simplification::measures_error requests it.
  double error() const { return error_; }

 private:
  using Group = GroupOfMesh<Number>;

  std::uint64_t own_bytes() const override {
    return mesh_.bytes() + sorted_bytes_ + numbers_.file_bytes();
  }
  std::uint64_t own_memory() const override;
  Progress& progress() {
    return simplification_.progress ? *simplification_.progress : no_progress();
  }
  std::optional<std::uint64_t> find_goal() const;
  void simplify_all();
  void find_collapses(TriangleGroups<Number>& groups, double part, double max_distance);
  void collapse(TriangleGroups<Number>& groups, std::uint64_t all, std::uint64_t wanted);
  void load_positions(Group& group);
  template <class F>
  void in_parallel(std::vector<Group>& groups, F&& f);
  template <class F>
  void for_each_run(TriangleGroups<Number>& groups, F&& f);
  void begin_next(std::uint64_t vertices);
  std::uint64_t number_kept();
  void write_kept();

  Simplification simplification_;
  std::uint64_t max_narrow_vertices_;
  MeshHeader header_;  ///< of the mesh that leaves
  tbb::task_arena arena_;
  std::size_t at_once_;  ///< groups
  ScratchPlace place_;
  std::uint64_t sorted_memory_;
  std::uint64_t sorted_bytes_ = 0;
  MeshSpool<Number> mesh_;
  CollapseSpool collapses_;
  ScratchArray<Number> numbers_;  ///< of kept vertices plus 1; 0: not kept
  MeshBounds bounds_;
  std::optional<std::uint64_t> goal_;
  double error_ = 0;
};

}  // namespace isobrick
