#pragma once

#include <gtest/gtest.h>

#include <cstddef>

#include "viewer/scene/drawable.h"
#include "viewer/scene/node_tree.h"

namespace isobrick::test {

/// Whether the nodes' boxes overlap.
inline bool overlap(const NodeGrid& grid, const NodeKey& a, const NodeKey& b) {
  const IndexBox p = grid.box(a), q = grid.box(b);
  for (int axis = 0; axis < 3; ++axis)
    if (p.hi[axis] <= q.lo[axis] || q.hi[axis] <= p.lo[axis]) return false;
  return true;
}

inline void expect_no_overlap(const NodeGrid& grid, const Drawable& drawable) {
  for (std::size_t i = 0; i < drawable.nodes.size(); ++i)
    for (std::size_t j = 0; j < i; ++j)
      if (drawable.nodes[i].isovalue == drawable.nodes[j].isovalue) {
        EXPECT_FALSE(overlap(grid, drawable.nodes[i].mesh->key, drawable.nodes[j].mesh->key));
      }
}

/// Whether each finest node with a surface lies in a drawn node, or in one whose own level has no
/// surface.
inline bool covers(const NodeTree& tree, const Drawable& drawable, double isovalue) {
  bool all = true;
  for_each_point({{0, 0, 0}, tree.grid().level(0).nodes}, [&](Int3 p) {
    bool found = false, shown = true;
    for (const NodeDraw& node : drawable.nodes)
      found |= overlap(tree.grid(), node.mesh->key, {0, p});
    for (NodeKey n{0, p};;) {
      shown &= tree.active(n, isovalue);
      if (!tree.grid().has_parent(n)) break;
      n = tree.grid().parent(n);
    }
    all &= found || !shown;
  });
  return all;
}

}  // namespace isobrick::test
