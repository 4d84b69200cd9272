#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include <isobrick/lattice.h>

namespace isobrick::inline v0 {

/// A tile that the isovalue touches, and which of its 2×2×2 blocks of 16³ cells
/// do it (bit = x + 2·y + 4·z).
struct TileWork {
  Int3 tile;  ///< position in units of kTileEdge
  std::uint8_t active_blocks = 0;
};

/// Samples of a tile without its apron.
inline constexpr std::uint64_t kTileVolume = std::uint64_t{kTileEdge} * kTileEdge * kTileEdge;

/// The cells of a tile's block, by its bit in TileWork::active_blocks.
constexpr Box3 cells_of_block(Int3 tile, int block) {
  const Int3 corner = tile * kTileEdge + Int3{block & 1, block >> 1 & 1, block >> 2} * kBlockEdge;
  return {corner, corner + Int3{kBlockEdge, kBlockEdge, kBlockEdge}};
}

/// The sample, in tile coordinates, that all blocks of a tile share: its middle,
/// or what is nearest to it in the volume. A block that is not active lies on
/// one side as a whole, and so on the side of this sample; whichever block is
/// active needs it.
constexpr Int3 common_sample(Int3 extent, Int3 tile) {
  return min({kBlockEdge, kBlockEdge, kBlockEdge}, extent - Int3{1, 1, 1} - tile * kTileEdge);
}

/// In place of a reach: only the samples that cells begin at, 32³ of a whole tile.
inline constexpr Index kFirstCorners = -1;

/// The samples that `active_blocks` of a tile need: their cells' corners and
/// `reach` layers more on every side, cut at the volume's border. Calls f(Box3)
/// for up to four boxes of rows that cover them.
template <class F>
void for_each_needed_box(const Lattice& lattice, const TileWork& work, Index reach, F&& f) {
  const Int3 origin = work.tile * kTileEdge;
  const Index before = std::max<Index>(reach, 0);
  const auto emit = [&](int blocks_x, Index y0, Index y1, Index z0, Index z1) {
    const Index x0 = blocks_x & 1 ? 0 : kBlockEdge;
    const Index x1 = blocks_x & 2 ? kTileEdge : kBlockEdge;
    const Box3 box{origin + Int3{x0 - before, y0 - before, z0 - before},
                   origin + Int3{x1 + 1 + reach, y1 + 1 + reach, z1 + 1 + reach}};
    const Box3 inside = intersect(box, lattice.box());
    if (!inside.empty()) f(inside);
  };
  const int pairs[4] = {work.active_blocks & 3, work.active_blocks >> 2 & 3,
                        work.active_blocks >> 4 & 3, work.active_blocks >> 6 & 3};
  if (pairs[0] && pairs[0] == pairs[1] && pairs[0] == pairs[2] && pairs[0] == pairs[3]) {
    emit(pairs[0], 0, kTileEdge, 0, kTileEdge);
    return;
  }
  for (int i = 0; i < 4; ++i)
    if (pairs[i]) {
      const Index y = (i & 1) * kBlockEdge, z = (i >> 1) * kBlockEdge;
      emit(pairs[i], y, y + kBlockEdge, z, z + kBlockEdge);
    }
}

/// Bricks that the samples of one tile, with `reach` layers around, can lie in.
constexpr std::size_t max_bricks_of_tile(const Lattice& lattice, Index reach) {
  Index bricks = 1;
  for (int axis = 0; axis < 3; ++axis) {
    const Index samples = std::min(kTileEdge + 1 + 2 * reach, lattice.extent[axis]);
    bricks *= std::min((samples - 2 + lattice.brick[axis]) / lattice.brick[axis] + 1,
                       lattice.bricks()[axis]);
  }
  return static_cast<std::size_t>(bricks);
}

}  // namespace isobrick
