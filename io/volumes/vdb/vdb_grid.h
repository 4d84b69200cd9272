#pragma once

// Making OpenVDB grids. Only for the writers, which see OpenVDB anyway.

#include <openvdb/openvdb.h>

#include <cstdint>
#include <string>

#include <isobrick/volume_source.h>
#include "io/bytes/output_file.h"

namespace isobrick::inline v0 {

/// The item of a grid's metadata that keeps the unit of world space.
inline constexpr const char* kVdbUnit = "unit";

/// Gives a grid the volume's place, unit and name.
void describe_vdb_grid(openvdb::GridBase& grid, const VolumeInfo& info, const std::string& name);

/// Writes the grid as all of `file`, and reads back where it ends. Throws Error when that fails.
void write_vdb_grid(OutputFile& file, const openvdb::GridBase::Ptr& grid);

inline openvdb::Coord vdb_coordinate(Int3 p) {
  return {static_cast<int>(p.x), static_cast<int>(p.y), static_cast<int>(p.z)};
}

/// Edge of OpenVDB's leaves.
inline constexpr Index kVdbLeaf = 8;
inline constexpr Int3 kVdbLeafExtent{kVdbLeaf, kVdbLeaf, kVdbLeaf};

/// Calls f(corner) for the leaves that have voxels of `box`, x fastest.
template <class F>
void for_each_vdb_leaf(Box3 box, F&& f) {
  for_each_point({floor_div(box.lo, kVdbLeafExtent), ceil_div(box.hi, kVdbLeafExtent)},
                 [&](Int3 leaf) { f(leaf * kVdbLeafExtent); });
}

/// Throws the UsageError of a grid that would take more than `budget` bytes.
[[noreturn]] void throw_vdb_budget(std::uint64_t budget);

/// Makes leaves and tiles of leaves in a tree and counts the bytes of the nodes that
/// come into being, which is faster than to query the tree. Throws UsageError before
/// they and the bytes of hold() take more than `budget`.
template <class Tree>
class CountedTree {
 public:
  using Value = typename Tree::ValueType;
  using Leaf = typename Tree::LeafNodeType;

  CountedTree(Tree& tree, std::uint64_t budget) : tree_(tree), budget_(budget) {}

  /// Sets the number of bytes that its owner holds beside the tree.
  void hold(std::uint64_t bytes) {
    held_ = bytes;
    add(0);
  }

  Leaf* probe_leaf(const openvdb::Coord& at) { return tree_.probeLeaf(at); }

  Leaf* touch_leaf(const openvdb::Coord& at) {
    if (Leaf* leaf = tree_.probeLeaf(at)) return leaf;
    add(sizeof(Leaf) + Leaf::SIZE * sizeof(Value));
    count_parents(at);
    return tree_.touchLeaf(at);
  }

  /// In place of the leaf there, of which there is none.
  void add_tile(const openvdb::Coord& at, const Value& value, bool active) {
    count_parents(at);
    tree_.addTile(1, at, value, active);
  }

 private:
  using Upper = typename Tree::RootNodeType::ChildNodeType;
  using Lower = typename Upper::ChildNodeType;

  void count_parents(const openvdb::Coord& at) {
    if (tree_.template probeConstNode<Lower>(at) != nullptr) return;
    add(sizeof(Lower));
    if (tree_.template probeConstNode<Upper>(at) == nullptr) add(sizeof(Upper));
  }

  void add(std::uint64_t bytes) {
    bytes_ += bytes;
    if (bytes_ + held_ > budget_) throw_vdb_budget(budget_);
  }

  Tree& tree_;
  std::uint64_t budget_, bytes_ = 0, held_ = 0;
};

}  // namespace isobrick
