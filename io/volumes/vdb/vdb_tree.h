#pragma once

// Reading OpenVDB trees by boxes. Only for the sources that see OpenVDB anyway.

#include <openvdb/openvdb.h>

#include <algorithm>
#include <cstring>
#include <limits>
#include <optional>
#include <span>
#include <type_traits>
#include <utility>
#include <vector>

namespace isobrick::inline v0 {

/// Whether two values have the same bits: a NaN equals itself.
template <class T>
bool same_bits(const T& a, const T& b) {
  return std::memcmp(&a, &b, sizeof(T)) == 0;
}

/// A value as a sample; a NaN becomes the one that fill values are.
template <class Out, class T>
Out to_sample(const T& value) {
  const auto sample = static_cast<Out>(value);
  if constexpr (std::is_floating_point_v<Out>)
    if (sample != sample) return std::numeric_limits<Out>::quiet_NaN();
  return sample;
}

/// Whether `box` (inclusive, in index coordinates, inside the node) meets neither
/// a leaf nor a tile of another value than `value`.
template <class Node, class T>
bool node_is_constant(const Node& node, const openvdb::CoordBBox& box, const T& value) {
  using Child = typename Node::ChildNodeType;
  constexpr int kChild = static_cast<int>(Child::DIM);
  const openvdb::Coord lo = (box.min() - node.origin()), hi = (box.max() - node.origin());
  for (int x = lo.x() / kChild; x <= hi.x() / kChild; ++x)
    for (int y = lo.y() / kChild; y <= hi.y() / kChild; ++y)
      for (int z = lo.z() / kChild; z <= hi.z() / kChild; ++z) {
        const openvdb::Coord origin =
            node.origin() + openvdb::Coord(x * kChild, y * kChild, z * kChild);
        const openvdb::Index slot = Node::coordToOffset(origin);
        if (!node.isChildMaskOn(slot)) {
          if (!same_bits(node.getTable()[slot].getValue(), value)) return false;
        } else if constexpr (Child::LEVEL == 0) {
          return false;
        } else {
          openvdb::CoordBBox part = box;
          part.intersect(openvdb::CoordBBox::createCube(origin, kChild));
          if (!node_is_constant(*node.getTable()[slot].getChild(), part, value)) return false;
        }
      }
  return true;
}

/// Whether every voxel of `box` is known to have the tree's background value.
template <class Tree>
bool box_is_background(const Tree& tree, const openvdb::CoordBBox& box) {
  const auto& root = tree.root();
  constexpr auto kSize = static_cast<int>(Tree::RootNodeType::ChildNodeType::DIM);
  for (auto it = root.cbeginChildAll(); it; ++it) {
    openvdb::CoordBBox part = box;
    part.intersect(openvdb::CoordBBox::createCube(it.getCoord(), kSize));
    if (part.empty()) continue;
    typename Tree::ValueType value;
    const auto* child = it.probeChild(value);
    if (child == nullptr ? !same_bits(value, tree.background())
                         : !node_is_constant(*child, part, tree.background()))
      return false;
  }
  return true;
}

/// The value of all voxels of `box`, if they are known to have the same: in tiles that
/// are one, of a box within one of the root's children, or in the background.
template <class Tree>
std::optional<typename Tree::ValueType> constant_value(const Tree& tree,
                                                       const openvdb::CoordBBox& box) {
  using Upper = typename Tree::RootNodeType::ChildNodeType;
  if (tree.probeConstLeaf(box.min()) != nullptr) return std::nullopt;
  const auto* node = tree.template probeConstNode<Upper>(box.min());
  if (node != nullptr && node->getNodeBoundingBox().isInside(box)) {
    const auto value = tree.getValue(box.min());
    return node_is_constant(*node, box, value) ? std::optional(value) : std::nullopt;
  }
  return box_is_background(tree, box) ? std::optional(tree.background()) : std::nullopt;
}

/// Copies what a cube of 8³ voxels and `box` share to `out`, C order [z, y, x]
/// over `box`; value(offset) gives a voxel's in the order of OpenVDB's leaves.
template <class Out, class Value>
void copy_cube(const openvdb::Coord& origin, const openvdb::CoordBBox& box, Value&& value,
               Out* out) {
  openvdb::CoordBBox part = box;
  part.intersect(openvdb::CoordBBox::createCube(origin, 8));
  const openvdb::Coord size = box.dim();
  const std::ptrdiff_t row = size.x(), plane = row * size.y();
  for (int z = part.min().z(); z <= part.max().z(); ++z)
    for (int y = part.min().y(); y <= part.max().y(); ++y) {
      Out* to = out + (z - box.min().z()) * plane + (y - box.min().y()) * row - box.min().x();
      const int inside = ((y & 7) << 3) | (z & 7);
      for (int x = part.min().x(); x <= part.max().x(); ++x)
        to[x] = value(static_cast<openvdb::Index>((x & 7) << 6 | inside));
    }
}

/// Copies the voxels of `box`, inactive ones with their own values, to `out`, C
/// order [z, y, x]. A mask's values are its states. `reader` reads the tree's leaves.
template <class Tree, class Reader, class Out>
void read_tree(const Tree& tree, Reader reader, const openvdb::CoordBBox& box, Out* out) {
  using Leaf = typename Tree::LeafNodeType;
  constexpr std::size_t kAtOnce = 64;
  // One that remembers leaves would allocate their values.
  const openvdb::tree::ValueAccessor2<const Tree, false, 1, 2> accessor(tree);
  std::fill_n(out, box.volume(), to_sample<Out>(tree.background()));
  std::vector<const Leaf*> leaves;
  const auto read_leaves = [&] {
    reader.read(std::span<const Leaf* const>(leaves), [&](const Leaf& leaf, const auto& value) {
      copy_cube(
          leaf.origin(), box, [&](openvdb::Index i) { return to_sample<Out>(value(i)); }, out);
    });
    leaves.clear();
  };
  openvdb::Coord at;
  // In the order in which leaves stand in a file.
  for (int x = box.min().x() & ~7; x <= box.max().x(); x += 8)
    for (int y = box.min().y() & ~7; y <= box.max().y(); y += 8) {
      for (int z = box.min().z() & ~7; z <= box.max().z(); z += 8) {
        at.reset(x, y, z);
        if (const auto* leaf = accessor.probeConstLeaf(at)) {
          leaves.push_back(leaf);
          if (leaves.size() == kAtOnce) read_leaves();
        } else if (const auto value = accessor.getValue(at); !same_bits(value, tree.background())) {
          const Out sample = to_sample<Out>(value);
          copy_cube(
              at, box, [&](openvdb::Index) { return sample; }, out);
        }
      }
    }
  read_leaves();
}

/// The smallest and the largest value, whether active or not, background included.
template <class Tree, class Reader>
std::pair<typename Tree::ValueType, typename Tree::ValueType> value_range(const Tree& tree,
                                                                          Reader reader) {
  auto lo = tree.background(), hi = lo;
  const auto include = [&](typename Tree::ValueType value) {
    lo = std::min(lo, value);
    hi = std::max(hi, value);
  };
  auto tile = tree.cbeginValueAll();
  tile.setMaxDepth(Tree::DEPTH - 2);
  for (; tile; ++tile) include(*tile);
  for (auto it = tree.cbeginLeaf(); it; ++it) {
    const typename Tree::LeafNodeType* leaf = &*it;
    reader.read(std::span(&leaf, 1), [&](const auto&, const auto& value) {
      for (openvdb::Index i = 0; i < Tree::LeafNodeType::SIZE; ++i) include(value(i));
    });
  }
  return {lo, hi};
}

}  // namespace isobrick
