#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

#include <isobrick/store_reader.h>
#include "core/flat_map.h"

namespace isobrick {

/// Edge, in cells of its level, of a node.
inline constexpr Index kNodeEdge = 64;

/// A node: a cube of kNodeEdge³ cells of one level's grid, fewer where the
/// volume ends. Level 0 is the finest.
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

/// The 26 directions in which a node has neighbours over faces, edges and
/// corners, each component −1, 0 or 1. Bit i of a mask of neighbours is
/// direction i.
inline constexpr int kDirections = 26;
constexpr Int3 direction(int i) {
  const int j = i < 13 ? i : i + 1;  // the one in the middle is the node itself
  return {j % 3 - 1, j / 3 % 3 - 1, j / 9 - 1};
}

/// Box in level-0 index space, whose cells lie between 0 and extent − 1.
struct IndexBox {
  Vec3d lo, hi;
  friend bool operator==(const IndexBox&, const IndexBox&) = default;
};

/// How nodes lie over a volume.
///
/// Stored levels do not nest: a sample of a filtered level stands in the middle
/// of those it averages, half a cell off. So nodes lie on grids of their own, all
/// of them on the samples of level 0: level v has grid points at every step-th
/// sample (a power of two on each axis), the last one at the volume's border
/// whatever the step. Points of a level are points of all finer ones, and nodes of
/// adjacent levels share faces exactly. The values there are interpolated between
/// the samples of the stored level; at level 0 they are the samples.
///
/// Above the coarsest stored level, unless that is large, are levels of every second of its
/// samples, every fourth, … until few cells are left: for pictures that have to be quick.
class NodeGrid {
 public:
  struct Level {
    int source = 0;  ///< the stored level whose samples are interpolated
    Int3 step;       ///< samples of level 0 between two grid points
    Int3 cells;      ///< of the grid
    Int3 nodes;      ///< how many there are
    Vec3d scale;     ///< stored sample = scale · p + offset, p in level-0 index space
    Vec3d offset;
    double spacing = 0;  ///< world length of a cell's longest edge
  };

  /// Throws Error when the levels lie at different angles.
  explicit NodeGrid(const StoreInfo& info);

  int levels() const { return static_cast<int>(levels_.size()); }
  /// The coarsest level that has samples of its own.
  int coarsest_stored() const { return coarsest_stored_; }
  const Level& level(int v) const { return levels_[static_cast<std::size_t>(v)]; }
  /// Level-0 index space to world space.
  const Transform& transform() const { return transform_; }
  /// Cells of level 0: the volume.
  Int3 cells() const { return cells_; }

  /// Grid points of a node along each axis are node · kNodeEdge … + cells.
  Int3 node_cells(const NodeKey& n) const;
  IndexBox box(const NodeKey& n) const;
  /// Place of a grid point, in samples of level 0.
  Index position(int v, int axis, Index point) const;

  bool has_parent(const NodeKey& n) const { return n.level + 1 < levels(); }
  NodeKey parent(const NodeKey& n) const {
    const Int3& halvings = halvings_[static_cast<std::size_t>(n.level)];
    return {n.level + 1, {n.node.x >> halvings.x, n.node.y >> halvings.y, n.node.z >> halvings.z}};
  }
  /// Positions of a node's children at the next finer level.
  Box3 children(const NodeKey& n) const;
  /// Grid points of level v between two of level v + 1 along each axis: 1 or 2.
  Int3 ratio(int v) const {
    const Int3& halvings = halvings_[static_cast<std::size_t>(v)];
    return {Index{1} << halvings.x, Index{1} << halvings.y, Index{1} << halvings.z};
  }

  /// Samples of the stored level that the node's values come from.
  Box3 samples(const NodeKey& n) const;
  /// Samples of level v's stored level that lie within a node of another one.
  Box3 samples_within(const NodeKey& n, int v) const;

  /// Between which stored samples the value at a grid point lies: `first` and
  /// the next one, the part `weight` of the way. weight is 0 where it is a sample.
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
  std::vector<Int3> halvings_;  ///< axes that the level above a level halves: 1, others 0
};

}  // namespace isobrick
