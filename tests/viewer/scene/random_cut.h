#pragma once

#include <random>
#include <set>
#include <tuple>
#include <vector>

#include "viewer/scene/active_nodes.h"
#include "viewer/scene/cut.h"

namespace isobrick::test {

/// Whether the grid has this node.
inline bool has_node(const NodeGrid& grid, const NodeKey& n) {
  return n.level >= 0 && n.level < grid.levels() &&
         Box3{{0, 0, 0}, grid.level(n.level).nodes}.contains(n.node);
}

/// A balanced LOD cut with `refinements` nodes refined at random, by a slow and simple algorithm.
class RandomCut {
 public:
  RandomCut(const NodeGrid& grid, unsigned seed, int refinements) : grid_(grid) {
    std::mt19937 random(seed);
    for (int i = 0; i < refinements; ++i) {
      const std::vector<NodeKey> nodes = leaves();
      const NodeKey n = nodes[random() % nodes.size()];
      if (n.level > 0) refine(n);
    }
  }

  /// With `active`, nodes of the finest level need not match neighbours without a surface.
  Cut cut(const std::vector<double>& isovalues, const ActiveNodes* active = nullptr) const {
    Cut cut;
    cut.isovalues = isovalues;
    for (const NodeKey& n : leaves())
      cut.nodes.push_back({n, coarser(n, active), 1.0f, 1.0f, true});
    return cut;
  }

 private:
  using Id = std::tuple<int, Index, Index, Index>;
  static Id id(const NodeKey& n) { return {n.level, n.node.x, n.node.y, n.node.z}; }
  bool refined(const NodeKey& n) const { return refined_.contains(id(n)); }

  void refine(const NodeKey& n) {
    if (refined(n)) return;
    if (grid_.has_parent(n)) refine(grid_.parent(n));
    for (int i = 0; i < kDirections; ++i) {
      const NodeKey m{n.level, n.node + direction(i)};
      if (has_node(grid_, m) && grid_.has_parent(m)) refine(grid_.parent(m));
    }
    refined_.insert(id(n));
  }
  std::uint32_t coarser(const NodeKey& n, const ActiveNodes* active) const {
    std::uint32_t mask = 0;
    for (int i = 0; i < kDirections; ++i) {
      const NodeKey m{n.level, n.node + direction(i)};
      if (!has_node(grid_, m) || !grid_.has_parent(m)) continue;
      const NodeKey above = grid_.parent(m);
      const bool nothing = active != nullptr && n.level == 0 && !active->below(above);
      if (!refined(above) && !nothing) mask |= 1u << i;
    }
    return mask;
  }
  std::vector<NodeKey> leaves() const {
    std::vector<NodeKey> nodes;
    const auto visit = [&](const auto& self, const NodeKey& n) -> void {
      if (!refined(n)) return nodes.push_back(n);
      for_each_point(grid_.children(n), [&](Int3 c) { self(self, {n.level - 1, c}); });
    };
    const int top = grid_.levels() - 1;
    for_each_point({{0, 0, 0}, grid_.level(top).nodes}, [&](Int3 p) { visit(visit, {top, p}); });
    return nodes;
  }

  const NodeGrid& grid_;
  std::set<Id> refined_;
};

}  // namespace isobrick::test
