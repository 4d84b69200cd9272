#include "viewer/scene/resident_meshes.h"

#include <cstddef>
#include <utility>

namespace isobrick::inline v0 {
namespace {

/// Old meshes free one in so many bytes of a full device's budget.
constexpr std::uint64_t kPartForNew = 8;

}  // namespace

void ResidentMeshes::set_cut(const Cut& cut, CutIndex index) {
  // While an isovalue slides, each change replaces the cut before it is complete. The last isovalue
  // that covered the view must stay visible, not the first.
  if (cut_.isovalues != cut.isovalues) (void)drawable();
  cut_ = cut;
  index_.emplace(std::move(index));
  ++version_;
}

MeshPlan ResidentMeshes::plan(const NodeMesher& mesher, double max_meshes) {
  cache_.begin_use();
  MeshPlan plan = plan_jobs(*tree_, cut_, cache_, mesher, max_meshes);
  make_room();
  return plan;
}

void ResidentMeshes::put(std::shared_ptr<const NodeMesh> mesh) {
  if (closed_) return;
  cache_.put(std::move(mesh));
  make_room();
  ++version_;
}

void ResidentMeshes::make_device_room() {
  const std::uint64_t budget = cache_.device_budget(), part = budget / kPartForNew;
  if (cache_.device_bytes() + part <= budget) return;
  mark_shown_used();
  cache_.shrink_device(part);
}

void ResidentMeshes::set_device_budget(std::uint64_t bytes) {
  cache_.set_device_budget(bytes);
  make_room();
}

/// Marks the shown meshes as used, even if the cut does not contain them.
void ResidentMeshes::mark_shown_used() {
  for (const auto& place : shown_)
    for (const NodeDraw& node : place)
      cache_.find(node.mesh->key, node.mesh->isovalue, node.mesh->coarser);
}

void ResidentMeshes::make_room() {
  full_ = false;
  if (cache_.is_within_budgets()) return;
  mark_shown_used();
  full_ = !cache_.shrink();
}

std::shared_ptr<const Drawable> ResidentMeshes::drawable() {
  if (!drawn_ || drawn_->version != version_) rebuild_drawable();
  return drawn_;
}

/// Updates the previous isovalue of an index, which stays visible, to this cut.
void ResidentMeshes::update_previous(std::size_t place) {
  std::vector<NodeDraw> nodes;
  bool complete = true;
  if (append_drawable(*tree_, *index_, shown_[place].front().mesh->isovalue,
                      static_cast<int>(place), cache_, nodes, complete))
    shown_[place] = std::move(nodes);
}

void ResidentMeshes::rebuild_drawable() {
  auto next = std::make_shared<Drawable>();
  next->version = version_;
  next->complete = next->covers = true;
  next->isovalues = cut_.isovalues;
  cache_.begin_use();
  shown_.resize(cut_.isovalues.size());
  for (std::size_t i = 0; index_ && i < cut_.isovalues.size(); ++i) {
    std::vector<NodeDraw> nodes;
    const bool covers = append_drawable(*tree_, *index_, cut_.isovalues[i], static_cast<int>(i),
                                        cache_, nodes, next->complete);
    next->complete &= covers;
    next->covers &= covers;
    // The previous isovalue stays visible while the new one has holes.
    const bool old = !shown_[i].empty() && shown_[i].front().mesh->isovalue != cut_.isovalues[i];
    if (covers || !old)
      shown_[i] = std::move(nodes);
    else
      update_previous(i);
    next->nodes.insert(next->nodes.end(), shown_[i].begin(), shown_[i].end());
  }
  for (const NodeDraw& node : next->nodes) next->triangles += node.mesh->triangles();
  drawn_ = std::move(next);
  make_room();
}

void ResidentMeshes::close() {
  closed_ = true;
  cache_ = MeshCache(0, 0);
  shown_.clear();
  drawn_.reset();
}

}  // namespace isobrick
