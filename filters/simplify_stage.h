#pragma once

#include <cstdint>
#include <vector>

#include <isobrick/progress.h>
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
};

/// Passes a simplified mesh on, whatever its size.
///
/// Triangles are sorted into groups of boxes, and each group is simplified by itself. Vertices on
/// the borders of groups stay, so neighbours fit together. Two more passes, with other boxes,
/// simplify what the first ones left along the borders. Kept vertices keep their place, normal and
/// order.
class SimplifyStage final : public FilterStage {
 public:
  SimplifyStage(MeshSink& next, std::stop_token cancel, const ScratchPlace& place,
                std::uint64_t memory, const Simplification& simplification);

  void begin(const MeshHeader& header) override;
  void write(const MeshChunk& chunk) override;
  void finish() override;

 private:
  std::uint64_t own_bytes() const override {
    return mesh_.bytes() + sorted_bytes_ + numbers_.file_bytes();
  }
  std::uint64_t own_memory() const override;
  Progress& progress() {
    return simplification_.progress ? *simplification_.progress : no_progress();
  }
  std::uint64_t target() const;
  void simplify_all();
  void run_pass(TriangleGroups& groups, const std::vector<std::uint64_t>& targets,
                double max_distance);
  std::vector<std::uint64_t> plan_targets(TriangleGroups& groups, std::uint64_t target);
  template <class F>
  void for_each_group(TriangleGroups& groups, F&& f);
  void write_kept();

  Simplification simplification_;
  ScratchPlace place_;
  std::uint64_t sorted_memory_;
  std::uint64_t sorted_bytes_ = 0;
  MeshSpool mesh_;
  ScratchArray<std::uint32_t> numbers_;  ///< of kept vertices plus 1; 0: not kept
  MeshBounds bounds_;
};

}  // namespace isobrick
