#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include <isobrick/range.h>
#include <isobrick/vec.h>
#include "index/index_format.h"
#include "index/interval_tree.h"
#include "index/kd_tree.h"
#include "index/linear_scan.h"
#include "index/octree.h"
#include "index/quadtree.h"
#include "index/stab_sinks.h"

// Span-space search: which of many ranges does an isovalue stab, min < iso <= max?
// All structures answer every query alike, each in an order of its own:
//   linear    ascending ids
//   octree    Z-order (Morton order) of the grid
//   interval, kdtree, quadtree   by their layout; fixed for given bytes
// Building and querying are single-threaded and share nothing: callers run many
// at once.

namespace isobrick::inline v0 {

/// The index of `ranges`, whose ids are their places. `grid` gives the extents
/// of the items for the octree, C order [z, y, x]; {n, 1, 1} where there is no
/// grid. Equal input makes equal bytes on every machine. Throws UsageError when
/// the grid is not that of the ranges, or for 2³² items and more.
template <class T>
std::vector<std::byte> build_index(IndexKind kind, std::span<const ValueRange<T>> ranges,
                                   Int3 grid);

/// Appends the ids of the stabbed items in the structure's order.
void query(const IndexView& index, double iso, std::vector<std::uint32_t>& ids);

/// Number of stabbed items. Costs no time per answer but in a linear scan and an octree.
std::uint64_t count(const IndexView& index, double iso);

/// Sets bit `id & 63` of word `id >> 6` for each stabbed item; `words` holds one
/// bit an item (mask_words).
void mark(const IndexView& index, double iso, std::span<std::uint64_t> words);
constexpr std::size_t mask_words(std::uint64_t items) {
  return static_cast<std::size_t>((items + 63) / 64);
}

/// Appends the ids of the stabbed items ascending. Goes through a bit for each
/// item, which is cheaper than sorting unless there are few answers.
void query_ascending(const IndexView& index, double iso, std::vector<std::uint32_t>& ids);

/// The work that a query does; for tests and for measuring.
QuerySteps count_steps(const IndexView& index, double iso);

/// Calls f(view) with the typed view of the structure: LinearView<T>,
/// IntervalView<T>, ….
template <class F>
decltype(auto) visit_index(const IndexView& index, F&& f) {
  return visit_scalar(index.type(), [&](auto tag) -> decltype(auto) {
    using T = typename decltype(tag)::type;
    using index_detail::view_of;
    const IndexHeader& header = index.header();
    switch (index.kind()) {
      case IndexKind::interval: return f(view_of<IntervalView<T>>(header, index.block()));
      case IndexKind::kdtree: return f(view_of<KdView<T>>(header, index.block()));
      case IndexKind::quadtree: return f(view_of<QuadtreeView<T>>(header, index.block()));
      case IndexKind::octree: return f(view_of<OctreeView<T>>(header, index.block()));
      case IndexKind::linear: break;
    }
    return f(view_of<LinearView<T>>(header, index.block()));
  });
}

}  // namespace isobrick
