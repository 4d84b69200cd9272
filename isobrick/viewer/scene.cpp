#include "isobrick/viewer/scene.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace isobrick {

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
  worker_ = std::make_unique<CutWorker>(*tree_, *search_, *stream_);
}

bool Scene::update(const std::vector<double>& isovalues, const View& view, const CutBudget& budget,
                   double patience) {
  const bool first = drawn_ == nullptr, again = std::exchange(again_, true);
  up_to_date_ = worker_->wait(0);
  CutRequest request{isovalues, view, budget};
  if (up_to_date_) {
    // A cut at the limit of its budget must not follow every mesh that is made.
    const double measured = counters().triangles_per_block;
    if (measured > 0 && std::abs(measured - per_block_) > 0.2 * per_block_) per_block_ = measured;
  }
  if (per_block_ > 0) request.budget.triangles_per_block = per_block_;
  if (again || request != asked_ || (up_to_date_ && !search_->found(isovalues))) {
    if (first) drawn_ = stream_->drawable();
    asked_ = request;
    worker_->ask(std::move(request));
  }
  up_to_date_ = false;
  up_to_date_ = worker_->wait(first ? std::numeric_limits<double>::infinity() : patience);
  again_ = false;
  cut_ = worker_->cut();
  return up_to_date_;
}

std::shared_ptr<const Drawable> Scene::drawable() {
  auto now = up_to_date_ ? stream_->drawable() : worker_->before();
  if (now != nullptr && (drawn_ == nullptr || now->version >= drawn_->version))
    drawn_ = std::move(now);
  return drawn_;
}

bool Scene::is_newest(const Drawable& drawable) const {
  return up_to_date_ && stream_->is_newest(drawable);
}

const StreamCounters& Scene::counters() {
  if (up_to_date_) counters_ = stream_->counters();
  return counters_;
}

}  // namespace isobrick
