#include "viewer/scene/cut.h"

#include <algorithm>
#include <array>
#include <queue>
#include <tuple>

namespace isobrick::inline v0 {
namespace {

/// Factor on the cell length of nodes that were refined in the previous cut.
constexpr double kHysteresis = 1.3;
/// Fraction of the budget for nodes that lose thin structure; they come first.
constexpr double kThinPart = 0.5;
/// Number of refinements that do not fit, after which the search for smaller ones ends.
constexpr int kMaxMisfits = 64;

/// A node that may be refined; the greatest comes first.
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

/// Candidates; those that lose thin structure are in a queue of their own.
class CandidateQueue {
 public:
  void push(const Candidate& candidate, bool loses) {
    (loses ? losing_ : regular_).push(candidate);
  }
  bool empty() const { return losing_.empty() && regular_.empty(); }
  struct Choice {
    NodeKey key;
    bool thin;  ///< loses thin structure
  };
  /// `thin_first`: prefer a node that loses thin structure.
  Choice pop(bool thin_first) {
    const bool thin =
        !losing_.empty() && (thin_first || regular_.empty() || regular_.top() < losing_.top());
    auto& queue = thin ? losing_ : regular_;
    const NodeKey key = queue.top().key;
    queue.pop();
    return {key, thin};
  }

 private:
  std::priority_queue<Candidate> losing_, regular_;
};

/// Tracks the triangles of a cut against the budget. Thin structure beyond the budget still leaves
/// a fraction of the budget to all other nodes.
class TriangleBudget {
 public:
  explicit TriangleBudget(const CutBudget& budget)
      : limit_(bounded(budget.triangles, budget)),
        thin_limit_(std::max(limit_, bounded(budget.thin_triangles, budget))) {}

  double used() const { return used_; }
  /// Whether thin structure may exceed the budget.
  bool can_exceed() const { return thin_limit_ > limit_; }
  /// Whether nodes that lose thin structure come first.
  bool thin_first() const { return used_ < thin_limit_ - kRegularPart * limit_; }
  bool fits(double more, bool thin) const {
    const double after = used_ + more, rest = kRegularPart * limit_ - std::max(regular_, 0.0);
    if (after <= limit_) return true;
    return thin ? after <= thin_limit_ - std::max(rest, 0.0) : after <= thin_limit_ && more <= rest;
  }
  void take(double more, bool thin) {
    used_ += more;
    if (!thin) regular_ += more;
  }

 private:
  static constexpr double kRegularPart = 1 - kThinPart;
  static double bounded(std::uint64_t triangles, const CutBudget& budget) {
    return static_cast<double>(std::min(triangles, budget.mesh_bytes / kBytesPerTriangle));
  }

  double limit_, thin_limit_;
  double used_ = 0, regular_ = 0;  ///< of all nodes; of nodes that lose no thin structure
};

constexpr int kNeighbourhood =
    27;  ///< a node and its neighbours: bit (z + 1) · 9 + (y + 1) · 3 + x + 1

/// For a child at each position in its parent and each direction from the child: the bit of the
/// parent's neighbour (or the parent) that lies there. Positions on an axis: the first of two
/// children, the second, or the only one.
using BitTable = std::array<std::array<std::uint8_t, kDirections>, kNeighbourhood>;

constexpr BitTable make_bits() {
  constexpr int steps[3][3] = {{-1, 0, 0}, {0, 0, 1}, {-1, 0, 1}};  // by position, then direction
  BitTable table{};
  for (std::size_t place = 0; place < kNeighbourhood; ++place)
    for (int i = 0; i < kDirections; ++i) {
      const Int3 d = direction(i);
      const int x = steps[place % 3][d.x + 1], y = steps[place / 3 % 3][d.y + 1],
                z = steps[place / 9][d.z + 1];
      table[place][static_cast<std::size_t>(i)] =
          static_cast<std::uint8_t>((z + 1) * 9 + (y + 1) * 3 + x + 1);
    }
  return table;
}
constexpr BitTable kBits = make_bits();

/// The row of kBits for a child.
std::size_t place_of(Int3 child, Int3 ratio, Int3 nodes) {
  const auto one = [](Index at, Index children, Index count) {
    // At the volume's border the second child may be missing.
    const bool only = children == 1 || (at % 2 == 0 && at + 1 == count);
    return static_cast<std::size_t>(only ? 2 : at & 1);
  };
  return one(child.x, ratio.x, nodes.x) + 3 * one(child.y, ratio.y, nodes.y) +
         9 * one(child.z, ratio.z, nodes.z);
}

}  // namespace

CutSelector::CutSelector(const NodeTree& tree)
    : tree_(tree), refined_(tree.grid(), 1), previous_(tree.grid(), 1), queued_(tree.grid(), 1) {}

double CutSelector::priority(const NodeKey& n, const NodeSight& sight, const ActiveNodes& active) {
  const bool before = previous_(n) != 0;
  if (!(before ? sight.nearly_visible : sight.visible) || !active.below(n)) return 0;
  return sight.pixels * (before ? kHysteresis : 1);
}

bool CutSelector::loses(const NodeKey& n, const ActiveNodes& active,
                        const CutBudget& budget) const {
  const std::vector<double>& isovalues = active.isovalues();
  return std::any_of(isovalues.begin(), isovalues.end(), [&](double iso) {
    return tree_.loses(n, iso) ||
           (budget.thin_triangles > 0 && tree_.thin_structure().lost(n, iso));
  });
}

double CutSelector::triangles(const NodeKey& n, const NodeView& view,
                              std::span<const double> isovalues, double per_block) const {
  if (view.clips(n)) return 0;
  int blocks = 0;
  for (const double iso : isovalues) blocks += tree_.active_blocks(n, iso);
  return blocks * per_block;
}

/// Change of the number of triangles when these nodes are replaced by their children.
double CutSelector::added_triangles(std::span<const NodeKey> refined, const NodeView& view,
                                    std::span<const double> isovalues, double per_block) const {
  double more = 0;
  for (const NodeKey& r : refined) {
    more -= triangles(r, view, isovalues, per_block);
    for_each_point(tree_.grid().children(r), [&](Int3 c) {
      more += triangles({r.level - 1, c}, view, isovalues, per_block);
    });
  }
  return more;
}

/// Appends `n` and, before it, all nodes that must be refined first so that neighbours differ by at
/// most one level.
void CutSelector::collect(const NodeKey& n, std::vector<NodeKey>& needed) {
  if (refined_(n) || queued_(n)) return;
  queued_(n) = 1;
  const NodeGrid& grid = tree_.grid();
  if (grid.has_parent(n)) {
    const Int3 ratio = grid.ratio(n.level);
    const NodeKey parent = grid.parent(n);
    // A child touches only the neighbours on its own side of the parent.
    Box3 around{parent.node, parent.node + Int3{1, 1, 1}};
    for (int axis = 0; axis < 3; ++axis) {
      const bool two = ratio[axis] == 2, second = (n.node[axis] & 1) != 0;
      if (!two || !second) --around.lo[axis];
      if (!two || second) ++around.hi[axis];
    }
    for_each_point(around, [&](Int3 p) { collect({parent.level, p}, needed); });
  }
  needed.push_back(n);
}

Cut CutSelector::select(const ActiveNodes& active, const View& view, const CutBudget& budget) {
  const std::vector<double>& isovalues = active.isovalues();
  const NodeGrid& grid = tree_.grid();
  const NodeView node_view(view, grid);
  std::swap(refined_, previous_);
  refined_.clear();
  CandidateQueue queue;
  TriangleBudget triangle_budget(budget);
  const double least_error = budget.thin_triangles > 0
                                 ? std::min(view.pixel_error, view.thin_pixel_error)
                                 : view.pixel_error;
  const auto add_candidate = [&](const NodeKey& n) {
    if (n.level <= view.finest_level) return;
    const double pixels = priority(n, node_view.sight(n), active);
    if (pixels <= least_error) return;
    const bool thin = loses(n, active, budget);
    if (pixels > (thin ? least_error : view.pixel_error)) queue.push({pixels, n}, thin);
  };
  const int top = grid.levels() - 1;
  const Box3 top_nodes{{0, 0, 0}, grid.level(top).nodes};
  for_each_point(top_nodes, [&](Int3 p) {
    triangle_budget.take(triangles({top, p}, node_view, isovalues, budget.triangles_per_block),
                         true);
    add_candidate({top, p});
  });

  Cut cut;
  cut.isovalues = isovalues;
  std::vector<NodeKey> needed;
  bool thin_first = true;
  for (int misfits = 0; misfits < kMaxMisfits && !queue.empty();) {
    const auto [n, thin] = queue.pop(thin_first && triangle_budget.thin_first());
    if (refined_(n)) continue;
    needed.clear();
    collect(n, needed);
    for (const NodeKey& r : needed) queued_(r) = 0;
    const double more = added_triangles(needed, node_view, isovalues, budget.triangles_per_block);
    if (!triangle_budget.fits(more, thin)) {
      cut.limited_by_budget = true;
      // Nodes that do not fit must not keep all others from being refined.
      if (thin && triangle_budget.can_exceed()) thin_first = false;
      ++misfits;
      continue;
    }
    triangle_budget.take(more, thin);
    for (const NodeKey& r : needed) {
      refined_(r) = 1;
      for_each_point(grid.children(r), [&](Int3 c) { add_candidate({r.level - 1, c}); });
    }
  }
  cut.triangles = static_cast<std::uint64_t>(std::max(triangle_budget.used(), 0.0));
  for_each_point(top_nodes, [&](Int3 p) { append({top, p}, 0, node_view, active, cut); });
  return cut;
}

/// Bits of the node and its neighbours that are not refined, not clipped, and to be matched by the
/// node's children. A neighbour without any surface need not be matched at the finest level: both
/// sides of the common face then lie on one side of the isovalue. (Points of coarser levels also
/// depend on samples beyond the face.) Its samples need not be read.
std::uint32_t CutSelector::coarse_around(const NodeKey& n, const NodeView& view,
                                         const ActiveNodes& active) {
  const auto may_meet = [&](const NodeKey& k) { return n.level > 1 || active.below(k); };
  std::uint32_t coarse = 0;
  std::uint32_t bit = 1;
  for_each_point({n.node - Int3{1, 1, 1}, n.node + Int3{2, 2, 2}}, [&](Int3 p) {
    const NodeKey k{n.level, p};
    if (!refined_(k) && !view.clips(k) && may_meet(k)) coarse |= bit;
    bit <<= 1;
  });
  return coarse;
}

void CutSelector::append(const NodeKey& n, std::uint32_t coarser, const NodeView& view,
                         const ActiveNodes& active, Cut& cut) {
  if (n.level == 0 || !refined_(n)) {
    const NodeSight sight = view.sight(n);
    cut.nodes.push_back({n, coarser, static_cast<float>(sight.pixels),
                         static_cast<float>(sight.distance), sight.visible, sight.clipped});
    return;
  }
  const std::uint32_t coarse = coarse_around(n, view, active);
  const Int3 ratio = tree_.grid().ratio(n.level - 1), nodes = tree_.grid().level(n.level - 1).nodes;
  for_each_point(tree_.grid().children(n), [&](Int3 c) {
    std::uint32_t mask = 0;
    const auto& bits = kBits[place_of(c, ratio, nodes)];
    for (std::size_t i = 0; coarse != 0 && i < bits.size(); ++i)
      mask |= (coarse >> bits[i] & 1u) << i;
    append({n.level - 1, c}, mask, view, active, cut);
  });
}

}  // namespace isobrick
