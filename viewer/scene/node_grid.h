#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

#include <isobrick/store_reader.h>
#include "core/flat_map.h"

namespace isobrick::inline v0 {

/// Edge of a node in cells of its level.
inline constexpr Index kNodeEdge = 64;

/// A node: a cube of kNodeEdge³ cells of one level's grid, smaller at the volume's end. Level 0 is
/// the finest.
struct NodeKey {
  int level = 0;
  Int3 node;
  friend bool operator==(const NodeKey&, const NodeKey&) = default;
};

struct NodeKeyHash {
  std::size_t operator()(const NodeKey& k) const {
    auto h = static_cast<std::uint64_t>(k.level);
    for (int axis = 0; axis < 3; ++axis)
      h = (h ^ static_cast<std::uint64_t>(k.node[axis])) * 0x9e3779b97f4a7c15ULL, h ^= h >> 29;
    return static_cast<std::size_t>(h);
  }
};

template <>
struct FlatKey<NodeKey> {
  static constexpr NodeKey kFree{-1, {}};
  static std::uint64_t number(const NodeKey& key) { return NodeKeyHash()(key); }
};

/// The 26 directions to the neighbours of a node over faces, edges and corners; each component is
/// −1, 0 or 1. Bit i of a mask of neighbours stands for direction i.
inline constexpr int kDirections = 26;
constexpr Int3 direction(int i) {
  const int j = i < 13 ? i : i + 1;  // skips the node itself
  return {j % 3 - 1, j / 3 % 3 - 1, j / 9 - 1};
}

/// Box in level-0 index space. The volume's cells lie between 0 and extent − 1.
struct IndexBox {
  Vec3d lo, hi;
  friend bool operator==(const IndexBox&, const IndexBox&) = default;
};

/// How nodes divide a volume.
///
/// Stored levels do not nest: a sample of a filtered level lies in the middle of those that it
/// averages, half a cell off. So each level of nodes has a grid of its own on the samples of level
/// 0. Level v has grid points at every step-th sample (a power of two on each axis), and one on the
/// volume's border whatever the step. Points of a level are points of all finer ones, and nodes of
/// adjacent levels share faces exactly. Values at grid points are interpolated between the samples
/// of the stored level; at level 0 they are the samples.
///
/// Above the coarsest stored level, unless that is large, are levels of every second of its
/// samples, every fourth, … until few cells are left. They make quick previews.
class NodeGrid {
 public:
  struct Level {
    int source = 0;  ///< the stored level whose samples are interpolated
    Int3 step;       ///< distance of grid points, in samples of level 0
    Int3 cells;      ///< extent of the grid in cells
    Int3 nodes;      ///< extent of the level in nodes
    Vec3d scale;     ///< stored sample = scale · p + offset, p in level-0 index space
    Vec3d offset;
    double spacing = 0;  ///< longest edge of a cell, world units
  };

  /// Throws Error if the levels have different directions.
  explicit NodeGrid(const StoreInfo& info);

  int levels() const { return static_cast<int>(levels_.size()); }
  /// The coarsest level with samples of its own.
  int coarsest_stored() const { return coarsest_stored_; }
  const Level& level(int v) const { return levels_[static_cast<std::size_t>(v)]; }
  /// Level-0 index space to world space.
  const Transform& transform() const { return transform_; }
  /// Extent of level 0 in cells.
  Int3 cells() const { return cells_; }

  /// Extent of a node in cells. Its grid points along an axis are node · kNodeEdge to node ·
  /// kNodeEdge + cells.
  Int3 node_cells(const NodeKey& n) const;
  IndexBox box(const NodeKey& n) const;
  /// Position of a grid point, in samples of level 0.
  Index position(int v, int axis, Index point) const;

  bool has_parent(const NodeKey& n) const { return n.level + 1 < levels(); }
  NodeKey parent(const NodeKey& n) const {
    const Int3& halvings = halvings_[static_cast<std::size_t>(n.level)];
    return {n.level + 1, {n.node.x >> halvings.x, n.node.y >> halvings.y, n.node.z >> halvings.z}};
  }
  /// The node's children, as a box of nodes of the next finer level.
  Box3 children(const NodeKey& n) const;
  /// Number of steps of level v in one of level v + 1 along each axis: 1 or 2.
  Int3 ratio(int v) const {
    const Int3& halvings = halvings_[static_cast<std::size_t>(v)];
    return {Index{1} << halvings.x, Index{1} << halvings.y, Index{1} << halvings.z};
  }

  /// The samples of the stored level that a node's values are interpolated from.
  Box3 samples(const NodeKey& n) const;
  /// The samples of level v's stored level that lie within a node of another level.
  Box3 samples_within(const NodeKey& n, int v) const;

  /// Interpolation of a grid point's value: between stored sample `first` and the next one,
  /// `weight` of the way. weight is 0 where the point is a sample.
  struct Interpolation {
    Index first = 0;
    double weight = 0;
  };
  Interpolation interpolation(int v, int axis, Index point) const;

 private:
  void add_levels(const StoreInfo& info, int source, Int3& exponents);
  void add_levels_above(const StoreInfo& info, Int3& exponents);
  void add_level(const StoreInfo& info, int source, Int3 exponents);

  Transform transform_;
  Int3 cells_;
  std::vector<Int3> stored_extents_;
  std::vector<Level> levels_;
  int coarsest_stored_ = 0;
  std::vector<Int3> halvings_;  ///< 1 for each axis that the next coarser level halves, else 0
};

}  // namespace isobrick
