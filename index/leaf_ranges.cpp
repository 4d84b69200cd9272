#include "index/leaf_ranges.h"

#include <algorithm>
#include <string>

#include <isobrick/error.h>
#include "index/instantiate.h"

namespace isobrick::inline v0 {
namespace {

/// Least and largest samples of several rows, place by place. The loops are such
/// that compilers turn them into vector instructions.
template <class T>
struct RowBounds {
  T* lo;
  T* hi;

  void start(const T* row, Index n) const {
    for (Index x = 0; x < n; ++x) {
      lo[x] = row[x] == row[x] ? row[x] : ValueRange<T>::kHighest;
      hi[x] = row[x] == row[x] ? row[x] : ValueRange<T>::kLowest;
    }
  }
  void include(const T* __restrict row, Index n) const {
    T* __restrict least = lo;
    T* __restrict largest = hi;
    for (Index x = 0; x < n; ++x) {
      least[x] = row[x] < least[x] ? row[x] : least[x];
      largest[x] = row[x] > largest[x] ? row[x] : largest[x];
    }
  }
  void include(const RowBounds& row, Index n) const {
    const T* __restrict from_lo = row.lo;
    const T* __restrict from_hi = row.hi;
    T* __restrict least = lo;
    T* __restrict largest = hi;
    for (Index x = 0; x < n; ++x) {
      least[x] = from_lo[x] < least[x] ? from_lo[x] : least[x];
      largest[x] = from_hi[x] > largest[x] ? from_hi[x] : largest[x];
    }
  }
};

template <class T>
ValueRange<T> range_of(const RowBounds<T>& row, Index begin, Index count) {
  ValueRange<T> range{row.lo[begin], row.hi[begin]};
  for (Index x = begin + 1; x < begin + count; ++x) range.include({row.lo[x], row.hi[x]});
  return range;
}

/// The ranges of a row of blocks from the bounds of its n samples' columns.
template <int Leaf, class T>
void reduce_row(const RowBounds<T>& row, Index n, ValueRange<T>* out) {
  const Index whole = (n - 1) / Leaf;
  for (Index b = 0; b < whole; ++b) out[b] = range_of(row, b * Leaf, Leaf + 1);
  if (whole * Leaf < n - 1) out[whole] = range_of(row, whole * Leaf, n - whole * Leaf);
}

/// Merges along z first, then y, then x: each step leaves less for the next.
template <int Leaf, class T>
void fill(const SampleBlock<T>& samples, ValueRange<T>* out) {
  const Int3 n = samples.extent, grid = leaf_grid(n, Leaf);
  std::vector<T> bounds(static_cast<std::size_t>(2 * n.x * (n.y + 1)));
  const auto row = [&](Index y) {
    T* lo = bounds.data() + 2 * n.x * y;
    return RowBounds<T>{lo, lo + n.x};
  };
  for (Index z = 0; z < grid.z; ++z) {
    const Index z0 = z * Leaf, z1 = std::min(z0 + Leaf, n.z - 1);
    for (Index y = 0; y < n.y; ++y) {
      const T* first = samples.data + y * samples.row_stride;
      row(y).start(first + z0 * samples.plane_stride, n.x);
      for (Index v = z0 + 1; v <= z1; ++v) row(y).include(first + v * samples.plane_stride, n.x);
    }
    for (Index y = 0; y < grid.y; ++y, out += grid.x) {
      const Index y0 = y * Leaf, y1 = std::min(y0 + Leaf, n.y - 1);
      const RowBounds<T> merged = row(n.y);
      std::copy_n(row(y0).lo, 2 * n.x, merged.lo);
      for (Index u = y0 + 1; u <= y1; ++u) merged.include(row(u), n.x);
      reduce_row<Leaf>(merged, n.x, out);
    }
  }
}

}  // namespace

template <class T>
void leaf_ranges(const SampleBlock<T>& samples, Index leaf, std::vector<ValueRange<T>>& ranges) {
  if (!is_leaf(leaf))
    throw UsageError("a leaf has 1, 2, 4, 8 or 16 cells along an edge, not " +
                     std::to_string(leaf));
  const Int3 grid = leaf_grid(samples.extent, leaf);
  ranges.resize(static_cast<std::size_t>(volume(grid)));
  if (ranges.empty()) return;
  switch (leaf) {
    case 1: return fill<1>(samples, ranges.data());
    case 2: return fill<2>(samples, ranges.data());
    case 4: return fill<4>(samples, ranges.data());
    case 8: return fill<8>(samples, ranges.data());
    default: return fill<16>(samples, ranges.data());
  }
}

#define ISOBRICK_INSTANTIATE(T) \
  template void leaf_ranges<T>(const SampleBlock<T>&, Index, std::vector<ValueRange<T>>&);
ISOBRICK_FOR_SAMPLE_TYPES(ISOBRICK_INSTANTIATE)
#undef ISOBRICK_INSTANTIATE

}  // namespace isobrick
