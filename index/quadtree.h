#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <isobrick/range.h>
#include "core/host_device.h"
#include "index/index_format.h"

namespace isobrick::inline v0 {

/// What the points of a quadtree's node have in common, and where they begin.
template <class T>
struct QuadNode {
  T min_lo, min_hi, max_lo, max_hi;  ///< bounds of the points' min and max
  std::uint32_t point;               ///< first of its points
  std::uint32_t skip;                ///< first node after its descendants
};

/// A quadtree in span space. Items with one (min, max) are one point with a
/// list of ids; points lie in Z-order of their bits, so that each node, a square
/// of span space, is a run of points and also a run of ids. Nodes lie before
/// their descendants; squares with one occupied quarter are left out.
template <class T>
struct QuadtreeView {
  static constexpr std::uint32_t kBucket = 8;  ///< points of a node that is not divided

  std::uint32_t nodes, points;
  const QuadNode<T>* node;     ///< nodes, and one more that ends the last node's points
  const std::uint32_t* first;  ///< points + 1: where each point's ids begin
  const std::uint32_t* ids;    ///< of each point ascending
  const T* mins;
  const T* maxs;

  ISOBRICK_HD QuadtreeView(const IndexHeader& header, SectionCursor& cursor)
      : nodes(header.nodes),
        points(header.points),
        node(cursor.take<QuadNode<T>>(std::uint64_t{header.nodes} + 1)),
        first(cursor.take<std::uint32_t>(std::uint64_t{header.points} + 1)),
        ids(cursor.take<std::uint32_t>(header.stored)),
        mins(cursor.take<T>(header.points)),
        maxs(cursor.take<T>(header.points)) {}

  static std::vector<std::byte> build(IndexHeader header, std::span<const ValueRange<T>> ranges);
  void check(const IndexHeader& header) const;
};

/// Reports the stabbed items by point in Z-order. Needs no stack: a node that
/// is rejected or taken whole is skipped with its descendants.
template <class T, class Sink>
ISOBRICK_HD void traverse(const QuadtreeView<T>& index, T value, Sink& sink) {
  for (std::uint32_t i = 0; i < index.nodes;) {
    const QuadNode<T> node = index.node[i];
    sink.node();
    if (!(node.min_lo < value && value <= node.max_hi)) {
      i = node.skip;
      continue;
    }
    const bool whole = node.min_hi < value && value <= node.max_lo;
    const bool leaf = node.skip == i + 1;
    if (whole) {
      const std::uint32_t begin = index.first[node.point];
      const std::uint32_t end = index.first[index.node[node.skip].point];
      sink.ids(index.ids + begin, end - begin);
    } else if (leaf) {
      const std::uint32_t end = index.node[node.skip].point;
      sink.tested(end - node.point);
      for (std::uint32_t p = node.point; p < end; ++p)
        if (index.mins[p] < value && value <= index.maxs[p])
          sink.ids(index.ids + index.first[p], index.first[p + 1] - index.first[p]);
    }
    i = whole ? node.skip : i + 1;
  }
}

}  // namespace isobrick
