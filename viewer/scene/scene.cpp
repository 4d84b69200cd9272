#include "viewer/scene/scene.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/stopwatch.h"

namespace isobrick::inline v0 {
namespace {

/// Whether both cuts request the same meshes; sizes and distances may differ.
bool same_cut(const Cut& a, const Cut& b) {
  return a.isovalues == b.isovalues &&
         std::equal(a.nodes.begin(), a.nodes.end(), b.nodes.begin(), b.nodes.end(),
                    [](const CutNode& p, const CutNode& q) {
                      return p.key == q.key && p.coarser == q.coarser && p.visible == q.visible &&
                             p.clipped == q.clipped;
                    });
}

}  // namespace

Vec3d middle_of(const NodeGrid& grid) {
  const Int3 cells = grid.cells();
  return grid.transform().apply({static_cast<double>(cells.x) / 2, static_cast<double>(cells.y) / 2,
                                 static_cast<double>(cells.z) / 2});
}

Scene::Scene(std::shared_ptr<const BrickSource> source, StreamOptions options)
    : tree_(std::make_shared<const NodeTree>(*source)), origin_(middle_of(tree_->grid())) {
  options.origin = origin_;
  const auto nodes = static_cast<std::uint64_t>(volume(tree_->grid().level(0).nodes));
  const std::uint64_t index = std::min(NodeSearch::building_bytes(nodes), options.brick_bytes / 4);
  options.brick_bytes -= index;
  search_ = std::make_unique<NodeSearch>(tree_, source->info().type, index, options.on_change);
  stream_ = std::make_unique<SceneStream>(std::move(source), tree_, std::move(options));
}

void Scene::update(const std::vector<double>& isovalues, const View& view,
                   const CutBudget& budget) {
  isovalues_ = isovalues;
  // A cut at the limit of its budget must not change with every new mesh.
  const double measured = stream_->counters().triangles_per_block;
  if (measured > 0 && std::abs(measured - triangles_per_block_) > 0.2 * triangles_per_block_)
    triangles_per_block_ = measured;
  CutRequest request{isovalues, view, budget, tree_->thin_structure().known()};
  if (triangles_per_block_ > 0) request.budget.triangles_per_block = triangles_per_block_;
  const bool same = chosen_ == request;
  if (same && search_->is_current(isovalues)) return;

  Stopwatch watch;
  CutTimes times;
  const ActiveNodes& active = search_->find(isovalues);
  times.search = watch.lap();
  if (!same) {
    chosen_.reset();
    Cut next = select(active, view, request.budget);
    times.cut = watch.lap();
    if (!same_cut(next, cut_)) {
      stream_->set_cut(next);
      cut_ = std::move(next);
    }
    times.plan = watch.lap();
    chosen_ = std::move(request);
  }
  times_ = times;
}

Cut Scene::select(const ActiveNodes& active, const View& view, const CutBudget& budget) {
  if (!selector_) selector_.emplace(*tree_);
  try {
    return selector_->select(active, view, budget);
  } catch (...) {
    selector_.reset();  // its state may be incomplete
    throw;
  }
}

}  // namespace isobrick
