#include "index/active_tiles.h"

namespace isobrick::inline v0 {
namespace {

template <class T>
const ValueRange<T>& range_of(Int3 block, Box3 blocks, std::span<const ValueRange<T>> ranges) {
  return ranges[static_cast<std::size_t>(linear_index(block - blocks.lo, blocks.extent()))];
}

}  // namespace

bool CapSearch::needs(Box3 cells, ValueRange<double> range, double isovalue) const {
  if (range.empty() || (inside == Inside::below ? !(range.lo < isovalue) : !(range.hi >= isovalue)))
    return false;
  const Box3 all{roi.lo, roi.hi - Int3{1, 1, 1}};
  if (intersect(cells, all).empty()) return false;
  if (everywhere) return true;
  for (int axis = 0; axis < 3; ++axis)
    if (cells.lo[axis] <= all.lo[axis] || cells.hi[axis] >= all.hi[axis]) return true;
  return false;
}

template <class T>
void append_active_tiles(Box3 blocks, std::span<const ValueRange<T>> ranges, double isovalue,
                         std::vector<TileWork>& tiles) {
  append_tiles_where(
      blocks, [&](Int3 block) { return range_of(block, blocks, ranges).stabbed_by(isovalue); },
      tiles);
}

template <class T>
void append_capped_tiles(Box3 blocks, std::span<const ValueRange<T>> ranges, double isovalue,
                         const CapSearch& cap, std::vector<TileWork>& tiles) {
  append_tiles_where(
      blocks,
      [&](Int3 block) {
        const ValueRange<T>& range = range_of(block, blocks, ranges);
        if (range.stabbed_by(isovalue)) return true;
        const Int3 lo = block * kBlockEdge;
        return cap.needs({lo, lo + Int3{kBlockEdge, kBlockEdge, kBlockEdge}},
                         {static_cast<double>(range.lo), static_cast<double>(range.hi)}, isovalue);
      },
      tiles);
}

#define ISOBRICK_INSTANTIATE(T)                                                      \
  template void append_active_tiles<T>(Box3, std::span<const ValueRange<T>>, double, \
                                       std::vector<TileWork>&);                      \
  template void append_capped_tiles<T>(Box3, std::span<const ValueRange<T>>, double, \
                                       const CapSearch&, std::vector<TileWork>&);
ISOBRICK_INSTANTIATE(std::uint8_t)
ISOBRICK_INSTANTIATE(std::int8_t)
ISOBRICK_INSTANTIATE(std::uint16_t)
ISOBRICK_INSTANTIATE(std::int16_t)
ISOBRICK_INSTANTIATE(std::uint32_t)
ISOBRICK_INSTANTIATE(std::int32_t)
ISOBRICK_INSTANTIATE(float)
ISOBRICK_INSTANTIATE(double)
#undef ISOBRICK_INSTANTIATE

}  // namespace isobrick
