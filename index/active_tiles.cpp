#include "index/active_tiles.h"

#include "core/morton.h"

namespace isobrick::inline v0 {

namespace {

/// Appends the tiles with a block for which is_active(range, block) holds; `block` counts from the
/// first one.
template <class T, class IsActive>
void append_tiles(Box3 blocks, std::span<const ValueRange<T>> ranges, const IsActive& is_active,
                  std::vector<TileWork>& tiles) {
  constexpr Index edge = kTileEdge / kBlockEdge;
  const Int3 extent = blocks.extent();
  const Int3 first_tile{blocks.lo.x / edge, blocks.lo.y / edge, blocks.lo.z / edge};
  for_each_morton(ceil_div(extent, {edge, edge, edge}), [&](Int3 t) {
    TileWork work{first_tile + t, 0};
    for (int i = 0; i < 8; ++i) {
      const Int3 block = t * edge + Int3{i & 1, i >> 1 & 1, i >> 2};
      if (!Box3{{0, 0, 0}, extent}.contains(block)) continue;
      const ValueRange<T>& range = ranges[static_cast<std::size_t>(linear_index(block, extent))];
      if (is_active(range, block)) work.active_blocks |= static_cast<std::uint8_t>(1 << i);
    }
    if (work.active_blocks) tiles.push_back(work);
  });
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
  append_tiles(
      blocks, ranges, [&](const ValueRange<T>& range, Int3) { return range.stabbed_by(isovalue); },
      tiles);
}

template <class T>
void append_capped_tiles(Box3 blocks, std::span<const ValueRange<T>> ranges, double isovalue,
                         const CapSearch& cap, std::vector<TileWork>& tiles) {
  append_tiles(
      blocks, ranges,
      [&](const ValueRange<T>& range, Int3 block) {
        if (range.stabbed_by(isovalue)) return true;
        const Int3 lo = (blocks.lo + block) * kBlockEdge;
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
