#pragma once

#include <bit>
#include <cstdint>
#include <span>
#include <vector>

#include <isobrick/range.h>
#include "core/host_device.h"
#include "index/index_format.h"

namespace isobrick::inline v0 {

/// Edelsbrunner's interval tree. Its nodes are the split values in ascending
/// order, as a balanced search tree without links: node r of 1 … nodes is the
/// parent of r ± half its lowest set bit. An item lives at the highest node
/// whose split value stabs it, in two lists.
template <class T>
struct IntervalView {
  std::uint32_t nodes;
  const std::uint32_t* first;  ///< nodes + 1: where the lists of node r = 1 … begin, at [r − 1]
  const std::uint32_t* by_min;  ///< ids of each list by ascending min
  const std::uint32_t* by_max;  ///< ids of each list by descending max
  const T* splits;
  const T* mins;  ///< of the items in by_min
  const T* maxs;  ///< of the items in by_max

  ISOBRICK_HD IntervalView(const IndexHeader& header, SectionCursor& cursor)
      : nodes(header.nodes),
        first(cursor.take<std::uint32_t>(std::uint64_t{header.nodes} + 1)),
        by_min(cursor.take<std::uint32_t>(header.stored)),
        by_max(cursor.take<std::uint32_t>(header.stored)),
        splits(cursor.take<T>(header.nodes)),
        mins(cursor.take<T>(header.stored)),
        maxs(cursor.take<T>(header.stored)) {}

  static std::vector<std::byte> build(IndexHeader header, std::span<const ValueRange<T>> ranges);
  void check(const IndexHeader& header) const;
};

namespace index_detail {

/// How many of n elements, those that satisfy `holds` first, do. Steps grow from
/// the front, so that it costs the logarithm of the answer.
template <class Holds, class Sink>
ISOBRICK_HD std::uint32_t prefix_length(std::uint32_t n, Holds holds, Sink& sink) {
  std::uint64_t low = 0, step = 1;
  for (; low + step <= n && holds(static_cast<std::uint32_t>(low + step - 1)); step *= 2) {
    low += step;
    sink.node();
  }
  std::uint64_t high = low + step - 1 < n ? low + step - 1 : n;
  while (low < high) {
    const std::uint64_t middle = (low + high) / 2;
    sink.node();
    if (holds(static_cast<std::uint32_t>(middle)))
      low = middle + 1;
    else
      high = middle;
  }
  return static_cast<std::uint32_t>(low);
}

/// 2^⌊log₂ n⌋, or 0.
ISOBRICK_HD inline std::uint32_t largest_power(std::uint32_t n) {
  std::uint32_t power = n ? 1 : 0;
  while (power <= n / 2 && power) power *= 2;
  return power;
}

}  // namespace index_detail

/// Reports the stabbed items: one path from the root, at each node a prefix of
/// one of its lists.
template <class T, class Sink>
ISOBRICK_HD void traverse(const IntervalView<T>& index, T value, Sink& sink) {
  std::uint32_t base = 0;
  for (std::uint32_t step = index_detail::largest_power(index.nodes); step; step /= 2) {
    const std::uint32_t node = base + step - 1;
    if (node >= index.nodes) continue;  // the tree ends here; as if the split were infinite
    sink.node();
    const T split = index.splits[node];
    const std::uint32_t first = index.first[node], n = index.first[node + 1] - first;
    if (value < split) {
      const T* mins = index.mins + first;
      const std::uint32_t k = index_detail::prefix_length(
          n, [=](std::uint32_t i) { return mins[i] < value; }, sink);
      if (k) sink.ids(index.by_min + first, k);
    } else if (split < value) {
      const T* maxs = index.maxs + first;
      const std::uint32_t k = index_detail::prefix_length(
          n, [=](std::uint32_t i) { return value <= maxs[i]; }, sink);
      if (k) sink.ids(index.by_max + first, k);
      base += step;
    } else {
      if (n) sink.ids(index.by_min + first, n);
      return;  // whatever lies below ends before the split or begins at it
    }
  }
}

}  // namespace isobrick
