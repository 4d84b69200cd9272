#pragma once

#include <cstdint>
#include <vector>

#include <isobrick/api.h>
#include <isobrick/lattice.h>
#include <isobrick/range.h>

namespace isobrick::inline v0 {

/// Items along each edge of a chunk of ranges as it is stored.
inline constexpr Index kRangeChunkEdge = 32;

/// Ranges of an aligned box of 16³ blocks (or of bricks), C order [z, y, x]
/// over `box`, as doubles: exact for all types but 64-bit ones that we don't have.
struct ISOBRICK_API RangeTable {
  Box3 box;                                ///< blocks or bricks
  std::vector<ValueRange<double>> ranges;  ///< one for each point of `box`
  std::uint64_t bytes_read = 0;            ///< from disk, for this table
  /// The range of the block or brick `p`, which lies in `box`.
  const ValueRange<double>& at(Int3 p) const {
    return ranges[static_cast<std::size_t>(linear_index(p - box.lo, box.extent()))];
  }
};

}  // namespace isobrick
