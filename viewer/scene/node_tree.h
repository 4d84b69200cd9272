#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include <isobrick/range.h>
#include "stream/brick_source.h"
#include "viewer/scene/node_grid.h"
#include "viewer/scene/thin_structure.h"

namespace isobrick {

/// The nodes of all levels with their ranges: some 56 bytes for each 64³ cells.
/// Immutable and so thread-safe once it is made.
class NodeTree {
 public:
  /// Reads the block ranges of all levels, in parallel in the caller's TBB arena.
  /// Throws what reading them throws.
  explicit NodeTree(const BrickSource& source);

  const NodeGrid& grid() const { return grid_; }

  /// Whether the node's own field may cross the isovalue: lo < isovalue <= hi.
  bool active(const NodeKey& n, double isovalue) const;
  /// Whether its field or that of any node below it may.
  bool active_below(const NodeKey& n, double isovalue) const;
  /// Whether its surface may hold anything when the neighbours in `coarser`
  /// (directions) lie one level above: a face takes their values.
  bool may_hold_surface(const NodeKey& n, double isovalue, std::uint32_t coarser) const;

  /// Whether a finer level crosses the isovalue within a part of the node, a 64th (of level 1: an
  /// eighth), where the node's own field does not: thin structure that averaging has removed.
  bool loses(const NodeKey& n, double isovalue) const;
  /// The same within smaller parts, once somebody has read the samples that it takes.
  ThinStructure& thin_structure() const { return *thin_structure_; }

  /// About how many of the node's blocks of 16³ cells are active (never fewer
  /// than there are).
  int active_blocks(const NodeKey& n, double isovalue) const;

  /// Own and of all nodes below it, in float, rounded outwards.
  ValueRange<float> range(const NodeKey& n) const { return at(n).own; }
  ValueRange<float> range_below(const NodeKey& n) const { return at(n).below; }

  std::uint64_t bytes() const;

 private:
  static constexpr int kParts = 8;
  struct Node {
    ValueRange<float> own, below;
    /// Blocks that are active in each part of the node's own range.
    std::array<std::uint8_t, kParts> blocks{};
  };

  const Node& at(const NodeKey& n) const {
    return nodes_[static_cast<std::size_t>(n.level)]
                 [static_cast<std::size_t>(linear_index(n.node, grid_.level(n.level).nodes))];
  }
  void read_nodes(const BrickSource& source, int v, Box3 nodes);
  std::uint8_t blocks_in(const NodeKey& n) const;
  Node summary(const RangeTable& table, Box3 blocks, std::uint8_t most) const;
  void merge_below(int v);
  static double part(const Node& node, double value);

  NodeGrid grid_;
  /// The level of the nodes within which a level's own field is known beside its own nodes.
  static int parts_level(int v) { return std::max(v - 2, 0); }
  Box3 parts_of(const NodeKey& n) const;
  void read_parts(const RangeTable& table, const NodeKey& n, Int3 all_blocks);

  std::vector<std::vector<Node>> nodes_;  ///< by level, x fastest
  /// By level, from 1 on: the range of its field within each node of parts_level().
  std::vector<std::vector<ValueRange<float>>> parts_;
  const std::unique_ptr<ThinStructure> thin_structure_;
};

}  // namespace isobrick
