#include "isobrick/viewer/scene.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "isobrick/core/stopwatch.h"

namespace isobrick {
namespace {

bool same_cut(const Cut& a, const Cut& b) {
  return a.isovalues == b.isovalues &&
         std::equal(a.nodes.begin(), a.nodes.end(), b.nodes.begin(), b.nodes.end(),
                    [](const CutNode& p, const CutNode& q) {
                      return p.key == q.key && p.coarser == q.coarser && p.visible == q.visible &&
                             p.cut_away == q.cut_away;
                    });
}

}  // namespace

Vec3d middle_of(const NodeGrid& grid) {
  const Int3 cells = grid.cells();
  return grid.transform().apply({static_cast<double>(cells.x) / 2, static_cast<double>(cells.y) / 2,
                                 static_cast<double>(cells.z) / 2});
}

Scene::Scene(std::shared_ptr<const BrickSource> source, StreamOptions options)
    : tree_(std::make_shared<const NodeTree>(*source)),
      origin_(middle_of(tree_->grid())),
      selector_(*tree_) {
  options.origin = origin_;
  const auto nodes = static_cast<std::uint64_t>(volume(tree_->grid().level(0).nodes));
  const std::uint64_t index = std::min(NodeSearch::building_bytes(nodes), options.brick_bytes / 4);
  options.brick_bytes -= index;
  search_ = std::make_unique<NodeSearch>(tree_, source->info().type, index, options.on_change);
  stream_ = std::make_unique<SceneStream>(std::move(source), tree_, std::move(options));
}

void Scene::update(const std::vector<double>& isovalues, const View& view, CutBudget budget) {
  // A cut at the limit of its budget must not follow every mesh that is made.
  const double measured = stream_->counters().triangles_per_block;
  if (measured > 0 && std::abs(measured - per_block_) > 0.2 * per_block_) per_block_ = measured;
  if (per_block_ > 0) budget.triangles_per_block = per_block_;
  times_ = {};
  Stopwatch watch;
  const ActiveNodes& active = search_->find(isovalues);
  times_.search = watch.lap();
  if (view_ == view && budget_ == budget && cut_.isovalues == isovalues) return;
  view_ = view;
  budget_ = budget;
  Cut cut = selector_.select(active, view, budget);
  const bool same = same_cut(cut, cut_);
  times_.cut = watch.lap();
  if (same) return;
  cut_ = std::move(cut);
  stream_->set_cut(cut_);
  times_.plan = watch.lap();
}

}  // namespace isobrick
