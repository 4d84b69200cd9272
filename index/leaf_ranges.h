#pragma once

#include <vector>

#include <isobrick/range.h>
#include <isobrick/vec.h>

namespace isobrick::inline v0 {

/// A box of samples somewhere in memory, x next to each other.
template <class T>
struct SampleBlock {
  const T* data = nullptr;
  Int3 extent;             ///< samples; one more than cells along each axis
  Index row_stride = 0;    ///< samples from (x, y, z) to (x, y + 1, z)
  Index plane_stride = 0;  ///< samples from (x, y, z) to (x, y, z + 1)

  /// Samples without gaps, C order [z, y, x].
  static SampleBlock dense(const T* data, Int3 extent) {
    return {data, extent, extent.x, extent.x * extent.y};
  }
};

/// True for the leaves that leaf_ranges knows: 1, 2, 4, 8 and 16 cells.
constexpr bool is_leaf(Index leaf) {
  return leaf == 1 || leaf == 2 || leaf == 4 || leaf == 8 || leaf == 16;
}

/// Blocks of leaf³ cells over so many samples, the last ones cut off. A brick of
/// B³ samples comes with one layer of its upper neighbours, where there are any.
constexpr Int3 leaf_grid(Int3 samples, Index leaf) {
  return ceil_div(max(samples - Int3{1, 1, 1}, Int3{0, 0, 0}), {leaf, leaf, leaf});
}

/// Sets `ranges` to those of the blocks of leaf³ cells, C order [z, y, x] of
/// leaf_grid: over all samples that a block's cells touch, NaN left out. Throws
/// UsageError unless is_leaf(leaf).
template <class T>
void leaf_ranges(const SampleBlock<T>& samples, Index leaf, std::vector<ValueRange<T>>& ranges);

}  // namespace isobrick
