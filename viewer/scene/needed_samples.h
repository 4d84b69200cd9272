#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include <isobrick/store_reader.h>

namespace isobrick::inline v0 {

/// Which samples a node of the finest level needs, by the ranges of its blocks of 16³ cells. Where
/// all samples of a block lie on one side of the isovalue, only the side is needed.
class NeededSamples {
 public:
  /// `samples`: those of the node's cells. `table`: ranges of at least the blocks that hold them. A
  /// block beside a neighbour in the mask `coarser` is always needed, since the neighbour's values
  /// are written onto the border.
  NeededSamples(Box3 samples, const RangeTable& table, double isovalue, std::uint32_t coarser);

  /// Whether any sample of `part` is needed, as a corner of a cell with a surface or for its
  /// gradient.
  bool any(Box3 part) const;
  /// Writes `below` or `above`, by their side, for the samples of `part` that are not needed. `to`:
  /// rows of an array of extent `to_extent`.
  template <class T>
  void fill(Box3 part, T below, T above, T* to, Int3 to_extent) const;

 private:
  Box3 blocks_;
  enum class Side : std::uint8_t { needed, below, above };
  std::vector<Side> sides_;  ///< for each block
};

/// Samples of the border take the side of the node's own block beside them.
template <class T>
void NeededSamples::fill(Box3 part, T below, T above, T* to, Int3 to_extent) const {
  const auto block = [&](int axis, Index p) {
    return std::clamp(p / kBlockEdge, blocks_.lo[axis], blocks_.hi[axis] - 1);
  };
  const Int3 n = blocks_.extent();
  for (Index z = part.lo.z; z < part.hi.z; ++z)
    for (Index y = part.lo.y; y < part.hi.y; ++y) {
      const Int3 row{blocks_.lo.x, block(1, y), block(2, z)};
      const Side* sides = &sides_[static_cast<std::size_t>(linear_index(row - blocks_.lo, n))];
      T* out = to + linear_index({0, y - part.lo.y, z - part.lo.z}, to_extent);
      for (Index x = part.lo.x; x < part.hi.x; ++x)
        *out++ = sides[block(0, x) - blocks_.lo.x] == Side::below ? below : above;
    }
}

}  // namespace isobrick
