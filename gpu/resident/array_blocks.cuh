#pragma once

#include "gpu/resident/array_tiles.cuh"

// The kernels that make tile blocks of the tiles of an array that a surface looks at.

namespace isobrick::inline v0::gpu {

/// Of a tile that has no block yet, while its block is chosen.
inline constexpr std::uint32_t kClaimed = kNone - 1;

/// Gives each tile a block that an active tile looks at: itself, those above it, with `reach` those
/// below it. A thread for each of the 27 tiles around an active one.
__global__ void __launch_bounds__(kArrayThreads)
    claim_blocks(const __grid_constant__ ArrayLoadParams p) {
  const std::uint64_t count = 27 * static_cast<std::uint64_t>(*p.found);
  const std::uint64_t step = static_cast<std::uint64_t>(gridDim.x) * kArrayThreads;
  for (std::uint64_t i = static_cast<std::uint64_t>(blockIdx.x) * kArrayThreads + threadIdx.x;
       i < count; i += step) {
    const TileItem item = p.items[i / 27];
    const int n = static_cast<int>(i % 27);
    const int dx = n % 3 - 1, dy = n / 3 % 3 - 1, dz = n / 9 - 1;
    if (::min(dx, ::min(dy, dz)) < -p.reach) continue;
    const int x = item.x + dx, y = item.y + dy, z = item.z + dz;
    if (x < 0 || y < 0 || z < 0 || x >= p.array.tiles[0] || y >= p.array.tiles[1] ||
        z >= p.array.tiles[2])
      continue;
    const auto place = static_cast<std::uint32_t>(
        (static_cast<std::int64_t>(z) * p.array.tiles[1] + y) * p.array.tiles[0] + x);
    if (atomicCAS(&p.block_of_tile[place], kNone, kClaimed) != kNone) continue;
    const std::uint32_t at = atomicAdd(&p.counts->wanted, 1u);
    if (at >= p.room) continue;
    p.places[at] = place;
    p.block_of_tile[place] = at + 1;
  }
}

/// Where a tile block and its first column are.
template <class T>
struct BlockOfArray {
  T *samples, *column;

  __device__ static BlockOfArray of(const ArrayLoadParams& p, std::uint32_t number) {
    return {static_cast<T*>(p.tile_blocks) + static_cast<std::size_t>(number) * kTileBlockSamples,
            static_cast<T*>(p.columns) + static_cast<std::size_t>(number) * kColumnSamples};
  }
  __device__ void write(T v, int row, int x) const {
    samples[32 * row + x] = v;
    if (x == 0) column[row] = v;
  }
};

/// Planes of 32² pass through shared memory, 16 KiB of them at a time.
template <int Fast, class T>
__device__ inline void copy_turned(const ArrayTile<T>& tile, const BlockOfArray<T>& block) {
  constexpr int kSlow = 3 - Fast, kBytes = static_cast<int>(sizeof(T)), kPlanes = 16 / kBytes;
  // Rows of more than 32 samples, so that a warp's stores fall into different banks.
  __shared__ T planes[kPlanes][32][32 + (kBytes < 4 ? 4 / kBytes : 1)];  // [slow, fast, x]
  const int lane = static_cast<int>(threadIdx.x % 32), warp = static_cast<int>(threadIdx.x / 32);
  for (int first = 0; first < tile.extent[kSlow]; first += kPlanes) {
    for_each_turned<Fast>(tile, first, kPlanes, [&](T v, int x, int fast, int slow) {
      planes[slow - first][fast][x] = v;
    });
    __syncthreads();
#pragma unroll 8
    for (int i = warp; i < 32 * kPlanes; i += kArrayWarps) {
      const int fast = i % 32, slow = first + i / 32;
      if (tile.has(0, lane) && tile.has(Fast, fast) && tile.has(kSlow, slow))
        block.write(planes[i / 32][fast][lane], Fast == 1 ? 32 * slow + fast : 32 * fast + slow,
                    lane);
    }
    __syncthreads();
  }
}

template <class T, ArrayOrder Order>
__device__ inline void copy_tile(const ArrayTile<T>& tile, const BlockOfArray<T>& block) {
  if constexpr (is_turned(Order))
    copy_turned<fast_axis(Order)>(tile, block);
  else if (Order == ArrayOrder::vectors && tile.extent[0] == 32)
    for_each_vector(tile, [&](const ArrayVector<T>& vector, int row, int x) {
      reinterpret_cast<uint4*>(block.samples + 32 * row + x)[0] = vector.words;
      if (x == 0) block.column[row] = vector.samples[0];
    });
  else
    for_each_in_rows(tile, [&](T v, int row, int x) { block.write(v, row, x); });
}

/// Copies the tiles whose blocks were claimed; where there is no room for all, nothing, and no tile
/// is active.
template <class T, ArrayOrder Order>
__global__ void __launch_bounds__(kArrayThreads)
    copy_tiles(const __grid_constant__ ArrayLoadParams p) {
  const std::uint32_t wanted = p.counts->wanted;
  if (wanted > p.room) {
    if (blockIdx.x == 0 && threadIdx.x == 0) *p.item_count = 0;
    return;
  }
  for (std::uint32_t i = p.counts->copied + blockIdx.x; i < wanted; i += gridDim.x)
    copy_tile<T, Order>(ArrayTile<T>::of(p.array, p.places[i]), BlockOfArray<T>::of(p, i + 1));
}

}  // namespace isobrick::gpu
