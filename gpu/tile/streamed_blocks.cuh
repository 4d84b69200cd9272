#pragma once

#include <cstdint>

#include "gpu/tile/block_groups.h"

// Where the samples of a streamed tile lie. A tile is read as if it had 27 tile blocks of 32³
// samples: its own and 26 around it. Of those 26 the kernel reads only the samples within one step
// of its 33³. Eight tiles share blocks for them: each tile has four columns, rows or planes of a
// block (of the edges and corners, four by four).
// docs/design/gpu.md has the picture.

namespace isobrick::inline v0::gpu {

/// Number of a tile's own block among the 27, x + 3·y + 9·z.
inline constexpr int kOwnBlock = 13;

/// Where block `n` of the streamed tile `number` begins, in samples from the first
/// tile's block. It may lie before that: only the places that are looked at do not.
__device__ inline std::int64_t streamed_block(std::uint32_t number, int n) {
  constexpr std::int64_t block = kTileBlockSamples, tiles = kTilesOfBlockGroup, patch = 4096;
  constexpr std::int64_t of_axis[3] = {tiles * block, (tiles + 1) * block, (tiles + 2) * block};
  constexpr std::int64_t of_edge_xy = (tiles + 3) * block, of_edge_xz = of_edge_xy + block,
                         of_edge_yz = of_edge_xz + patch, of_corner = of_edge_yz + patch;
  static_assert(of_corner + patch == kBlockGroupSamples);
  const std::int64_t group =
      static_cast<std::int64_t>(number / kTilesOfBlockGroup) * kBlockGroupSamples;
  const int tile = static_cast<int>(number % kTilesOfBlockGroup);
  const int x = n % 3 - 1, y = n / 3 % 3 - 1, z = n / 9 - 1;
  // Of an upper neighbour the samples 0 and 1 are looked at, of a lower one 31: they are
  // three of four places.
  const auto place = [](int direction) { return direction > 0 ? 0 : 2 - 31; };
  if (x == 0 && y == 0 && z == 0) return group + tile * block;
  // The first axis on which the block is another than the tile's has the fours of all tiles.
  const int first = 4 * tile;
  if (y == 0 && z == 0) return group + of_axis[0] + first + place(x);
  if (x == 0 && z == 0) return group + of_axis[1] + (first + place(y)) * 32;
  if (x == 0 && y == 0) return group + of_axis[2] + (first + place(z)) * 1024;
  if (z == 0) return group + of_edge_xy + first + place(x) + place(y) * 32;
  if (y == 0) return group + of_edge_xz + first + place(x) + place(z) * 1024;
  if (x == 0) return group + of_edge_yz + (first + place(y)) * 32 + place(z) * 1024;
  return group + of_corner + first + place(x) + place(y) * 32 + place(z) * 1024;
}

}  // namespace isobrick::gpu
