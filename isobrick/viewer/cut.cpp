#include "isobrick/viewer/cut.h"

#include <algorithm>
#include <queue>
#include <tuple>

namespace isobrick {
namespace {

/// By how much cells count as longer in nodes that were refined before.
constexpr double kHysteresis = 1.3;

/// A node that may be refined. The greatest is the next.
struct Candidate {
  double pixels;
  NodeKey key;

  friend bool operator<(const Candidate& a, const Candidate& b) {
    const auto order = [](const Candidate& c) {
      return std::tuple(c.pixels, c.key.level, -c.key.node.z, -c.key.node.y, -c.key.node.x);
    };
    return order(a) < order(b);
  }
};

}  // namespace

CutSelector::CutSelector(const NodeTree& tree) : tree_(tree) { restart(); }

void CutSelector::restart() {
  for (Flags* flags : {&refined_, &before_, &wanted_}) {
    flags->clear();
    for (int v = 0; v < tree_.grid().levels(); ++v)
      flags->emplace_back(static_cast<std::size_t>(volume(tree_.grid().level(v).nodes)));
  }
}

std::uint8_t& CutSelector::flag(Flags& flags, const NodeKey& n) const {
  return flags[static_cast<std::size_t>(n.level)]
              [static_cast<std::size_t>(linear_index(n.node, tree_.grid().level(n.level).nodes))];
}

double CutSelector::urgency(const NodeKey& n, std::span<const double> isovalues,
                            const NodeView& view) {
  const bool active = std::any_of(isovalues.begin(), isovalues.end(),
                                  [&](double iso) { return tree_.active_below(n, iso); });
  if (n.level == 0 || !active) return 0;
  const bool before = flag(before_, n) != 0;
  if (!(before ? view.nearly_visible(n) : view.visible(n))) return 0;
  return view.pixels(n) * (before ? kHysteresis : 1);
}

double CutSelector::triangles(const NodeKey& n, std::span<const double> isovalues,
                              double per_block) const {
  int blocks = 0;
  for (const double iso : isovalues) blocks += tree_.active_blocks(n, iso);
  return blocks * per_block;
}

/// `n` after all nodes that must be refined before it, so that no two neighbours
/// are more than a level apart.
void CutSelector::collect(const NodeKey& n, std::vector<NodeKey>& needed) {
  if (refined(n) || flag(wanted_, n)) return;
  flag(wanted_, n) = 1;
  const NodeGrid& grid = tree_.grid();
  if (grid.has_parent(n))
    for (int i = 0; i < kDirections; ++i) {
      const NodeKey neighbour{n.level, n.node + direction(i)};
      if (grid.contains(neighbour)) collect(grid.parent(neighbour), needed);
    }
  needed.push_back(n);
}

Cut CutSelector::select(std::span<const double> isovalues, const View& view,
                        const CutBudget& budget) {
  const NodeGrid& grid = tree_.grid();
  const NodeView node_view(view, grid);
  std::swap(refined_, before_);
  for (auto& level : refined_) std::fill(level.begin(), level.end(), std::uint8_t{0});
  std::priority_queue<Candidate> queue;
  const double most =
      static_cast<double>(std::min(budget.triangles, budget.mesh_bytes / kBytesPerTriangle));
  double used = 0;
  const auto enter = [&](const NodeKey& n) {
    used += triangles(n, isovalues, budget.triangles_per_block);
    const double pixels = urgency(n, isovalues, node_view);
    if (pixels > view.pixel_error) queue.push({pixels, n});
  };
  const int top = grid.levels() - 1;
  for_each_point({{0, 0, 0}, grid.level(top).nodes}, [&](Int3 p) { enter({top, p}); });

  Cut cut;
  cut.isovalues.assign(isovalues.begin(), isovalues.end());
  std::vector<NodeKey> needed;
  while (!queue.empty()) {
    const NodeKey n = queue.top().key;
    queue.pop();
    if (refined(n)) continue;
    needed.clear();
    collect(n, needed);
    double more = 0;
    for (const NodeKey& r : needed) {
      flag(wanted_, r) = 0;
      more -= triangles(r, isovalues, budget.triangles_per_block);
      for_each_point(grid.children(r), [&](Int3 c) {
        more += triangles({r.level - 1, c}, isovalues, budget.triangles_per_block);
      });
    }
    if (used + more > most) {
      cut.limited_by_budget = true;
      break;
    }
    for (const NodeKey& r : needed) {
      flag(refined_, r) = 1;
      used -= triangles(r, isovalues, budget.triangles_per_block);
      for_each_point(grid.children(r), [&](Int3 c) { enter({r.level - 1, c}); });
    }
  }
  cut.triangles = static_cast<std::uint64_t>(std::max(used, 0.0));
  for_each_point({{0, 0, 0}, grid.level(top).nodes}, [&](Int3 p) {
    append({top, p}, node_view, cut);
  });
  return cut;
}

std::uint32_t CutSelector::coarser_neighbours(const NodeKey& n) {
  const NodeGrid& grid = tree_.grid();
  if (!grid.has_parent(n)) return 0;
  std::uint32_t mask = 0;
  for (int i = 0; i < kDirections; ++i) {
    const NodeKey neighbour{n.level, n.node + direction(i)};
    if (grid.contains(neighbour) && !refined(grid.parent(neighbour))) mask |= 1u << i;
  }
  return mask;
}

void CutSelector::append(const NodeKey& n, const NodeView& view, Cut& cut) {
  if (refined(n)) {
    for_each_point(tree_.grid().children(n), [&](Int3 c) { append({n.level - 1, c}, view, cut); });
    return;
  }
  cut.nodes.push_back({n, coarser_neighbours(n), static_cast<float>(view.pixels(n)),
                       static_cast<float>(view.distance(n)), view.visible(n)});
}

}  // namespace isobrick
