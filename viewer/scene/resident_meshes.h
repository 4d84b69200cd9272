#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "viewer/scene/drawable.h"
#include "viewer/scene/stream_plan.h"

namespace isobrick {

/// The node meshes that are resident, within their budgets, and what of them shows an LOD cut.
/// Not thread-safe.
class ResidentMeshes {
 public:
  /// Budgets in bytes, of host memory and of a device's.
  ResidentMeshes(std::shared_ptr<const NodeTree> tree, std::uint64_t budget,
                 std::uint64_t device_budget)
      : tree_(std::move(tree)), cache_(budget, device_budget) {}

  /// From now on this cut is to be shown. `index`: of the same cut.
  void set_cut(const Cut& cut, CutIndex index);
  const Cut& cut() const { return cut_; }

  /// The meshes that the cut lacks; see plan_jobs(). What the cut uses is kept from now on.
  MeshPlan plan(const NodeMesher& mesher, double max_meshes);
  void put(std::shared_ptr<const NodeMesh> mesh);
  /// For meshes that do not fit on the device beside those that are there: older ones give back a
  /// part of the budget. The budget itself may never be reached, since places fall between.
  void make_device_room();
  void set_device_budget(std::uint64_t bytes);

  /// What to draw now; the same object until something changes. Until an isovalue covers the view,
  /// what the one in its place showed before is kept.
  std::shared_ptr<const Drawable> drawable();
  bool is_newest(const Drawable& drawable) const { return drawable.version == version_; }

  /// Whether what is shown and planned fills a budget: nothing more fits.
  bool full() const { return full_; }
  std::uint64_t meshes() const { return cache_.meshes(); }
  std::uint64_t bytes() const { return cache_.bytes(); }
  std::uint64_t device_bytes() const { return cache_.device_bytes(); }

  /// Drops all meshes, and takes none any more.
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
  std::vector<std::vector<NodeDraw>> shown_;  ///< what each isovalue's place shows
  bool full_ = false, closed_ = false;
  std::uint64_t version_ = 0;  ///< of what could be drawn
  std::shared_ptr<const Drawable> drawn_;
};

}  // namespace isobrick
