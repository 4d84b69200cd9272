#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "viewer/scene/drawable.h"
#include "viewer/scene/stream_plan.h"

namespace isobrick::inline v0 {

/// The resident node meshes, within their budgets, and the part of them that shows an LOD cut. Not
/// thread-safe.
class ResidentMeshes {
 public:
  /// Budgets in bytes of host memory, and of device memory.
  ResidentMeshes(std::shared_ptr<const NodeTree> tree, std::uint64_t budget,
                 std::uint64_t device_budget)
      : tree_(std::move(tree)), cache_(budget, device_budget) {}

  /// Sets the cut to show. `index`: of the same cut.
  void set_cut(const Cut& cut, CutIndex index);
  const Cut& cut() const { return cut_; }

  /// Plans the meshes that the cut lacks; see plan_jobs(). The meshes that the cut uses are kept.
  MeshPlan plan(const NodeMesher& mesher, double max_meshes);
  void put(std::shared_ptr<const NodeMesh> mesh);
  /// Makes room for meshes that do not fit on the device: drops a fraction of the budget of old
  /// meshes. Fragmentation may leave the budget itself out of reach.
  void make_device_room();
  void set_device_budget(std::uint64_t bytes);

  /// The meshes to draw now; the same object until something changes. Until an isovalue covers the
  /// view, the previous isovalue of its index stays visible.
  std::shared_ptr<const Drawable> drawable();
  bool is_newest(const Drawable& drawable) const { return drawable.version == version_; }

  /// Whether the meshes in use fill a budget, so that no mesh fits.
  bool full() const { return full_; }
  std::uint64_t meshes() const { return cache_.meshes(); }
  std::uint64_t bytes() const { return cache_.bytes(); }
  std::uint64_t device_bytes() const { return cache_.device_bytes(); }

  /// Drops all meshes and accepts no others.
  void close();

 private:
  void mark_shown_used();
  void make_room();
  void rebuild_drawable();
  void update_previous(std::size_t place);

  std::shared_ptr<const NodeTree> tree_;
  MeshCache cache_;
  Cut cut_;
  std::optional<CutIndex> index_;
  std::vector<std::vector<NodeDraw>> shown_;  ///< meshes shown for each isovalue
  bool full_ = false, closed_ = false;
  std::uint64_t version_ = 0;  ///< changes with the meshes and the cut
  std::shared_ptr<const Drawable> drawn_;
};

}  // namespace isobrick
