#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "viewer/scene/node_grid.h"

namespace isobrick::inline v0 {

/// A byte for each node above the finest level. Each level has a border one node wide, so that code
/// can read neighbours without a bounds check.
class NodeFlags {
 public:
  /// All 0; the border has the value `border`.
  NodeFlags(const NodeGrid& grid, std::uint8_t border) {
    for (int v = 1; v < grid.levels(); ++v) {
      const Int3 n = grid.level(v).nodes;
      levels_.push_back({n, n.x + 2, (n.x + 2) * (n.y + 2), {}});
      Level& level = levels_.back();
      level.flags.assign(static_cast<std::size_t>(level.slab * (n.z + 2)), border);
    }
    clear();
  }

  /// Sets all but the border to 0.
  void clear() {
    for (Level& level : levels_)
      for (Index z = 0; z < level.nodes.z; ++z)
        for (Index y = 0; y < level.nodes.y; ++y)
          std::fill_n(level.flags.begin() + level.index({0, y, z}), level.nodes.x, std::uint8_t{0});
  }

  /// n.level >= 1; a node or a neighbour of one.
  std::uint8_t& operator()(const NodeKey& n) {
    Level& level = levels_[static_cast<std::size_t>(n.level - 1)];
    return level.flags[static_cast<std::size_t>(level.index(n.node))];
  }
  std::uint8_t operator()(const NodeKey& n) const {
    const Level& level = levels_[static_cast<std::size_t>(n.level - 1)];
    return level.flags[static_cast<std::size_t>(level.index(n.node))];
  }

  /// The flags of the nodes (0, y, z), (1, y, z), … of a level.
  std::uint8_t* row(int v, Index y, Index z) {
    Level& level = levels_[static_cast<std::size_t>(v - 1)];
    return level.flags.data() + level.index({0, y, z});
  }

 private:
  struct Level {
    Int3 nodes;
    Index row, slab;
    std::vector<std::uint8_t> flags;

    Index index(Int3 p) const { return (p.z + 1) * slab + (p.y + 1) * row + p.x + 1; }
  };

  std::vector<Level> levels_;
};

}  // namespace isobrick
