#pragma once

#include "gpu/tile/streamed_blocks.cuh"
#include "gpu/tile/tile_block_place.cuh"
#include "gpu/tile/tile_classify.cuh"

// Before the first step: which tile is the next, and where its samples lie.

namespace isobrick::inline v0::gpu {

/// Pages of the tiles around one, and the first columns of those one higher along x; where
/// there is none, any that is. The first warp.
template <class T>
__device__ inline void find_tile_blocks(TileShared& s, const TileParams& p, const TileItem& item,
                                        std::uint32_t number) {
  if (threadIdx.x >= 31) return;
  const int column = static_cast<int>(threadIdx.x) - 27;
  const int n = column < 0 ? static_cast<int>(threadIdx.x)
                           : block_at(32, 32 * (column & 1), 32 * (column >> 1));
  const int dx = n % 3 - 1, dy = n / 3 % 3 - 1, dz = n / 9 - 1;
  std::int64_t start = 0;
  std::uint32_t block = 0;
  if (p.links) {
    start = streamed_block(number, n);
  } else {
    const int x = item.x + dx, y = item.y + dy, z = item.z + dz;
    const bool exists =
        x >= 0 && y >= 0 && z >= 0 && x < p.tiles[0] && y < p.tiles[1] && z < p.tiles[2];
    block =
        exists ? block_of_place(p, (static_cast<std::int64_t>(z) * p.tiles[1] + y) * p.tiles[0] + x)
               : p.fill_tile_block;
    start = static_cast<std::int64_t>(block) * kTileBlockSamples;
  }
  const auto address = [](const void* from, std::int64_t samples) {
    return reinterpret_cast<std::uintptr_t>(from) + samples * static_cast<std::int64_t>(sizeof(T));
  };
  // Samples of the tile blocks, or columns, between.
  const int before = dx * 32 + dy * 1024 + dz * 32768, columns_before = dy * 32 + dz * 1024;
  if (column < 0)
    s.tile_blocks[n] = address(p.tile_blocks, start - before);
  else if (p.columns)
    s.columns[column] =
        address(p.columns, static_cast<std::int64_t>(block) * kColumnSamples - columns_before);
  else
    s.columns[column] = address(p.tile_blocks, start - before + 32);
}

/// The number of the next tile, for the first thread; others get anything.
__device__ inline std::uint32_t next_number(const TileParams& p) {
  return threadIdx.x == 0 ? atomicAdd(p.ticket, 1u) : 0;
}

/// The first warp takes the tile with that number.
template <class T>
__device__ inline void take_tile(TileShared& s, const TileParams& p, std::uint32_t number) {
  if (warp_id() != 0) return;
  number = __shfl_sync(kFullMask, number, 0);
  if (lane_id() == 0) s.item = number;
  if (number >= s.items) return;
  const TileItem tile = p.items[number];
  find_tile_blocks<T>(s, p, tile, number);
  if (lane_id() == 0) {
    s.tile = tile;
    s.shape = shape_of(p, tile);
  }
}

}  // namespace isobrick::gpu
