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

namespace isobrick::inline v0 {

/// The nodes of all levels with their ranges; about 56 bytes for each 64³ cells. Immutable but for
/// thin_structure(), and thread-safe.
class NodeTree {
 public:
  /// Reads the block ranges of all levels, in parallel in the caller's TBB arena. Throws what
  /// reading ranges throws.
  explicit NodeTree(const BrickSource& source);

  const NodeGrid& grid() const { return grid_; }

  /// Whether the node's own field may cross the isovalue: lo < isovalue <= hi.
  bool active(const NodeKey& n, double isovalue) const;
  /// The same for the node or any node below it.
  bool active_below(const NodeKey& n, double isovalue) const;
  /// Whether its mesh may have triangles when the neighbours in the mask `coarser` lie one level
  /// above, since borders take their values.
  bool may_hold_surface(const NodeKey& n, double isovalue, std::uint32_t coarser) const;

  /// Whether averaging has removed thin structure: a finer level crosses the isovalue within a part
  /// of the node (a 64th; of level 1 an eighth), where the node's own field does not.
  bool loses(const NodeKey& n, double isovalue) const;
  /// The same for smaller parts; known once a thread has read its samples.
  ThinStructure& thin_structure() const { return *thin_structure_; }

  /// Upper estimate of the node's active blocks of 16³ cells.
  int active_blocks(const NodeKey& n, double isovalue) const;

  /// Range of the node's own samples, and of all samples below it, as float rounded outwards.
  ValueRange<float> range(const NodeKey& n) const { return at(n).own; }
  ValueRange<float> range_below(const NodeKey& n) const { return at(n).below; }

  std::uint64_t bytes() const;

 private:
  static constexpr int kParts = 8;
  struct Node {
    ValueRange<float> own, below;
    /// Number of active blocks in each part of the node's own range.
    std::array<std::uint8_t, kParts> blocks{};
  };

  const Node& at(const NodeKey& n) const {
    return nodes_[static_cast<std::size_t>(n.level)]
                 [static_cast<std::size_t>(linear_index(n.node, grid_.level(n.level).nodes))];
  }
  void read_nodes(const BrickSource& source, int v, Box3 nodes);
  std::uint8_t blocks_in(const NodeKey& n) const;
  Node summary(const RangeTable& table, Box3 blocks, std::uint8_t max_blocks) const;
  void merge_below(int v);
  static double part(const Node& node, double value);

  NodeGrid grid_;
  /// parts_ has the range of a level's field within each node of this level.
  static int parts_level(int v) { return std::max(v - 2, 0); }
  Box3 parts_of(const NodeKey& n) const;
  void read_parts(const RangeTable& table, const NodeKey& n, Int3 all_blocks);

  std::vector<std::vector<Node>> nodes_;  ///< by level, x fastest
  /// By level, from 1 on: the range of its field within each node of parts_level().
  std::vector<std::vector<ValueRange<float>>> parts_;
  const std::unique_ptr<ThinStructure> thin_structure_;
};

}  // namespace isobrick
