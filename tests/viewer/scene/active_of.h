#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "viewer/scene/active_nodes.h"

namespace isobrick::test {

/// Tests the range of each node.
inline ActiveNodes active_of(const NodeTree& tree, std::span<const double> isovalues) {
  const Int3 nodes = tree.grid().level(0).nodes;
  std::vector<std::uint64_t> finest(static_cast<std::size_t>(volume(nodes) + 63) / 64);
  for_each_point({{0, 0, 0}, nodes}, [&](Int3 p) {
    const auto id = static_cast<std::size_t>(linear_index(p, nodes));
    for (const double iso : isovalues)
      if (tree.active({0, p}, iso)) finest[id / 64] |= std::uint64_t{1} << id % 64;
  });
  ActiveNodes active(tree);
  active.set(isovalues, std::move(finest));
  return active;
}

}  // namespace isobrick::test
