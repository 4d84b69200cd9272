#include "viewer/scene/active_nodes.h"

#include <algorithm>
#include <bit>
#include <utility>

namespace isobrick::inline v0 {

ActiveNodes::ActiveNodes(const NodeTree& tree) : tree_(tree), above_(tree.grid(), 0) {
  const auto nodes = static_cast<std::uint64_t>(volume(tree.grid().level(0).nodes));
  finest_.resize(static_cast<std::size_t>((nodes + 63) / 64));
}

void ActiveNodes::set(std::span<const double> isovalues, std::vector<std::uint64_t> finest) {
  isovalues_.assign(isovalues.begin(), isovalues.end());
  finest_ = std::move(finest);
  above_.clear();
  count_ = 0;
  for (const std::uint64_t word : finest_)
    count_ += static_cast<std::uint64_t>(std::popcount(word));
  const NodeGrid& grid = tree_.grid();
  for (int v = 0; v + 1 < grid.levels(); ++v) {
    const Int3 nodes = grid.level(v).nodes;
    const bool halved = grid.ratio(v).x == 2;
    for (Index z = 0; z < nodes.z; ++z)
      for (Index y = 0; y < nodes.y; ++y) {
        const Int3 parent = grid.parent({v, {0, y, z}}).node;
        std::uint8_t* const above = above_.row(v + 1, parent.y, parent.z);
        const auto mark_parent = [&](Index x) { above[halved ? x / 2 : x] = 1; };
        if (v == 0) {
          for_each_bit((z * nodes.y + y) * nodes.x, nodes.x, mark_parent);
          continue;
        }
        const std::uint8_t* const own = above_.row(v, y, z);
        for (Index x = 0; x < nodes.x; ++x)
          if (own[x]) mark_parent(x);
      }
  }
}

/// Calls f(i) for each i < count whose bit first + i is set.
template <class F>
void ActiveNodes::for_each_bit(Index first, Index count, F&& f) const {
  for (Index at = first; at < first + count;) {
    const Index word = at / 64, end = std::min((word + 1) * 64, first + count);
    std::uint64_t bits = finest_[static_cast<std::size_t>(word)] >> at % 64;
    if (end - at < 64) bits &= (std::uint64_t{1} << (end - at)) - 1;
    for (; bits != 0; bits &= bits - 1) f(at - first + std::countr_zero(bits));
    at = end;
  }
}

bool ActiveNodes::below(const NodeKey& n) const {
  if (n.level == 0) {
    const auto id = static_cast<std::size_t>(linear_index(n.node, tree_.grid().level(0).nodes));
    return (finest_[id / 64] >> id % 64 & 1) != 0;
  }
  return above_(n) != 0 || std::any_of(isovalues_.begin(), isovalues_.end(),
                                       [&](double iso) { return tree_.active(n, iso); });
}

}  // namespace isobrick
