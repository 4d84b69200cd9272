#include "viewer/scene/node_search.h"

#include <algorithm>
#include <utility>

#include <fmt/format.h>

#include "core/stopwatch.h"
#include "index/span_index.h"

namespace isobrick::inline v0 {
namespace {

/// Bytes for the headers of two indices and for the padding of their arrays.
constexpr std::uint64_t kHeaders = 1 << 12;

/// Builds the index over the finest nodes' ranges. They are float; T holds them exactly.
template <class T>
std::vector<std::byte> build_as(IndexKind kind, const NodeTree& tree) {
  const Int3 nodes = tree.grid().level(0).nodes;
  std::vector<ValueRange<T>> ranges;
  ranges.reserve(static_cast<std::size_t>(volume(nodes)));
  for_each_point({{0, 0, 0}, nodes}, [&](Int3 p) {
    const ValueRange<float> r = tree.range({0, p});
    ranges.push_back(r.empty() ? ValueRange<T>{}
                               : ValueRange<T>{static_cast<T>(r.lo), static_cast<T>(r.hi)});
  });
  return build_index<T>(kind, ranges, nodes);
}

}  // namespace

std::string size_text(std::uint64_t bytes) {
  const auto kib = static_cast<double>(bytes) / 1024;
  return kib < 1024 ? fmt::format("{:.1f} KiB", kib) : fmt::format("{:.1f} MiB", kib / 1024);
}

NodeSearch::NodeSearch(std::shared_ptr<const NodeTree> tree, ScalarType type,
                       std::uint64_t max_bytes, std::function<void()> on_change)
    : tree_(std::move(tree)),
      type_(type),
      max_bytes_(max_bytes),
      on_change_(std::move(on_change)),
      active_(*tree_) {
  state_.nodes = static_cast<std::uint64_t>(volume(tree_->grid().level(0).nodes));
  Stopwatch watch;
  Bytes bytes = build(IndexKind::linear);
  set_index(IndexKind::linear, std::move(bytes), watch.lap());
  builder_ = std::thread([this] { build_requested(); });
}

NodeSearch::~NodeSearch() {
  {
    const MutexLock lock(mutex_);
    stop_ = true;
  }
  change_.notify_all();
  builder_.join();
}

/// Measured with distinct floats, including the ranges that the index is built from.
std::uint64_t NodeSearch::building_bytes(IndexKind kind, std::uint64_t nodes) {
  switch (kind) {
    case IndexKind::interval: return nodes * 60;
    case IndexKind::kdtree: return nodes * 60;
    case IndexKind::quadtree: return nodes * 72;
    case IndexKind::octree:
    case IndexKind::linear: break;
  }
  return nodes * 20;
}

std::uint64_t NodeSearch::building_bytes(std::uint64_t nodes) {
  std::uint64_t largest = 0;
  for (const IndexKind kind : kIndexKinds) largest = std::max(largest, building_bytes(kind, nodes));
  // The previous index answers meanwhile; its build memory is free again.
  return largest + nodes * 25 + kHeaders;
}

std::vector<std::byte> NodeSearch::build(IndexKind kind) const {
  return visit_scalar(type_, [&](auto tag) {
    using T = typename decltype(tag)::type;
    // Ranges of wider types were rounded outwards to float.
    if constexpr (sizeof(T) <= 2)
      return build_as<T>(kind, *tree_);
    else
      return build_as<float>(kind, *tree_);
  });
}

void NodeSearch::set_index(IndexKind kind, Bytes bytes, double seconds) {
  state_.kind = kind;
  state_.bytes = bytes.size();
  state_.build_seconds = seconds;
  state_.refused.clear();
  index_ = std::make_shared<const Bytes>(std::move(bytes));
}

void NodeSearch::use(IndexKind kind) {
  {
    const MutexLock lock(mutex_);
    requested_ = kind;
    state_.refused.clear();
    state_.building = requested_ != state_.kind;
  }
  change_.notify_all();
}

void NodeSearch::wait() {
  const MutexLock lock(mutex_);
  while (state_.building) change_.wait(mutex_);
}

/// Waits for a request; nullopt: there will be none.
std::optional<IndexKind> NodeSearch::next_to_build() {
  const MutexLock lock(mutex_);
  while (!stop_ && !state_.building) change_.wait(mutex_);
  if (stop_) return std::nullopt;
  return requested_;
}

/// Returns false if another kind has been requested meanwhile.
bool NodeSearch::finish_building(IndexKind kind, std::optional<Bytes> built, double seconds,
                                 std::string refused) {
  const MutexLock lock(mutex_);
  if (requested_ != kind) return false;
  if (built) set_index(kind, std::move(*built), seconds);
  state_.building = false;
  state_.refused = std::move(refused);
  change_.notify_all();
  return true;
}

void NodeSearch::build_requested() {
  while (const std::optional<IndexKind> kind = next_to_build()) {
    const State now = state();
    const std::uint64_t need = building_bytes(*kind, now.nodes) + now.bytes;
    std::string refused;
    std::optional<Bytes> built;
    Stopwatch watch;
    if (need > max_bytes_)
      refused = fmt::format("the {} index of {} nodes takes {} to build, of {}", name_of(*kind),
                            now.nodes, size_text(need), size_text(max_bytes_));
    else
      built = build(*kind);
    const bool changed = finish_building(*kind, std::move(built), watch.lap(), std::move(refused));
    if (changed && on_change_) on_change_();
  }
}

std::shared_ptr<const NodeSearch::Bytes> NodeSearch::index() const {
  const MutexLock lock(mutex_);
  return index_;
}

bool NodeSearch::is_current(std::span<const double> isovalues) const {
  return index() == searched_ && std::equal(isovalues.begin(), isovalues.end(),
                                            active_.isovalues().begin(), active_.isovalues().end());
}

const ActiveNodes& NodeSearch::find(std::span<const double> isovalues) {
  if (is_current(isovalues)) return active_;
  std::shared_ptr<const Bytes> index = this->index();
  const IndexView view = view_index(*index);
  std::vector<std::uint64_t> finest(mask_words(view.items()));
  Stopwatch watch;
  for (const double iso : isovalues) mark(view, iso, finest);
  const double seconds = watch.lap();
  active_.set(isovalues, std::move(finest));
  searched_ = std::move(index);
  const MutexLock lock(mutex_);
  state_.search_seconds = seconds;
  state_.active = active_.count();
  return active_;
}

NodeSearch::State NodeSearch::state() const {
  const MutexLock lock(mutex_);
  return state_;
}

}  // namespace isobrick
