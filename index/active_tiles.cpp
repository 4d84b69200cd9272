#include "index/active_tiles.h"

#include "core/morton.h"

namespace isobrick::inline v0 {

template <class T>
void append_active_tiles(Box3 blocks, std::span<const ValueRange<T>> ranges, double isovalue,
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
      if (range.stabbed_by(isovalue)) work.active_blocks |= static_cast<std::uint8_t>(1 << i);
    }
    if (work.active_blocks) tiles.push_back(work);
  });
}

#define ISOBRICK_INSTANTIATE(T)                                                      \
  template void append_active_tiles<T>(Box3, std::span<const ValueRange<T>>, double, \
                                       std::vector<TileWork>&);
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
