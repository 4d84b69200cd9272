#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <isobrick/range.h>
#include "core/host_device.h"
#include "index/index_format.h"

namespace isobrick::inline v0 {

/// A balanced k-d tree in span space with nothing but the items, in tree order:
/// the node of the places [begin, end) is its middle item, before it lie those
/// that are less by min (at even depth) or by max (at odd depth), after it the
/// others. At most kBucket items are not divided any more.
template <class T>
struct KdView {
  static constexpr std::uint32_t kBucket = 16;
  static constexpr int kMaxDepth = 32;

  std::uint32_t stored;
  const std::uint32_t* ids;
  const T* mins;
  const T* maxs;

  ISOBRICK_HD KdView(const IndexHeader& header, SectionCursor& cursor)
      : stored(header.stored),
        ids(cursor.take<std::uint32_t>(header.stored)),
        mins(cursor.take<T>(header.stored)),
        maxs(cursor.take<T>(header.stored)) {}

  static std::vector<std::byte> build(IndexHeader header, std::span<const ValueRange<T>> ranges);
  void check(const IndexHeader& header) const;
};

namespace index_detail {

/// Places [begin, end) yet to be searched, and what the path to them has shown.
struct KdPart {
  std::uint32_t begin, end;
  bool by_max;                ///< the axis that divides it
  bool min_holds, max_holds;  ///< true of all its items
};

template <class T, class Sink>
ISOBRICK_HD void report_bucket(const KdView<T>& index, const KdPart& part, T value, Sink& sink) {
  sink.tested(part.end - part.begin);
  for (std::uint32_t i = part.begin; i < part.end; ++i)
    if ((index.mins[i] < value) & (value <= index.maxs[i])) sink.id(index.ids[i]);
}

}  // namespace index_detail

/// Reports the stabbed items in tree order. A part of which both conditions are
/// known is reported whole.
template <class T, class Sink>
ISOBRICK_HD void traverse(const KdView<T>& index, T value, Sink& sink) {
  using index_detail::KdPart;
  // Of each divided part at most one half waits, and halves shrink by two.
  KdPart waiting[KdView<T>::kMaxDepth + 1];
  int depth = 0;
  KdPart part{0, index.stored, false, false, false};
  for (;;) {
    while (part.end - part.begin > KdView<T>::kBucket && !(part.min_holds && part.max_holds)) {
      sink.node();
      const std::uint32_t middle = part.begin + (part.end - part.begin) / 2;
      const bool min_holds = index.mins[middle] < value, max_holds = value <= index.maxs[middle];
      if (min_holds && max_holds) sink.id(index.ids[middle]);
      KdPart lower{part.begin, middle, !part.by_max, part.min_holds, part.max_holds};
      KdPart upper{middle + 1, part.end, !part.by_max, part.min_holds, part.max_holds};
      if (part.by_max) {
        upper.max_holds |= max_holds;
        part = upper;
        if (max_holds) waiting[depth++] = lower;
      } else {
        lower.min_holds |= min_holds;
        part = lower;
        if (min_holds) waiting[depth++] = upper;
      }
    }
    if (part.begin < part.end) {
      if (part.min_holds && part.max_holds)
        sink.ids(index.ids + part.begin, part.end - part.begin);
      else
        index_detail::report_bucket(index, part, value, sink);
    }
    if (depth == 0) return;
    part = waiting[--depth];
  }
}

}  // namespace isobrick
