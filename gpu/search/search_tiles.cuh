#pragma once

#include <isobrick/range.h>
#include "gpu/search/search_params.h"
#include "gpu/tile/tile_block_place.cuh"
#include "gpu/tile/tile_place.cuh"

// The kernel that finds active tiles, and those that make what it and the extraction read of a
// volume: ranges and first columns.

namespace isobrick::inline v0::gpu {

inline constexpr int kSearchThreads = 256, kSearchWarps = kSearchThreads / 32;
inline constexpr int kTilesOfSearchThread = static_cast<int>(kTilesOfSearchBlock) / kSearchThreads;

/// Of one value a warp: the sum before this warp and of all.
struct SumOfWarps {
  std::uint32_t before, all;
};

__device__ inline SumOfWarps sum_of_warps(const std::uint32_t* values) {
  SumOfWarps sum;
  const std::uint32_t v = lane_id() < kSearchWarps ? values[lane_id()] : 0;
  sum.all = warp_sum(v);
  sum.before = warp_sum(lane_id() < warp_id() ? v : 0u);
  return sum;
}

/// Where tile (t[0], t[1], t[2]) lies in C order [z, y, x].
__device__ inline std::size_t place_of(const std::int32_t* t, const std::int32_t (&grid)[3]) {
  return (static_cast<std::size_t>(t[2]) * grid[1] + t[1]) * grid[0] + t[0];
}

/// Whether a tile has cells at the border of the region of interest.
__device__ inline bool is_at_border(const SearchParams& p, std::uint32_t i) {
  bool at_border = false;
#pragma unroll
  for (int axis = 0; axis < 3; ++axis) {
    const int origin = p.tiles[3 * static_cast<std::size_t>(i) + axis] * 32;
    at_border = at_border || origin <= p.roi_lo[axis] || origin + 32 >= p.roi_hi[axis] - 1;
  }
  return at_border;
}

/// Whether the isovalue stabs the tile's range, or a cap needs the tile.
template <class T>
__device__ bool is_needed(const SearchParams& p, std::uint32_t i) {
  if (p.all) return true;
  const T* range = static_cast<const T*>(p.ranges) + 2 * static_cast<std::size_t>(i);
  const auto lo = static_cast<double>(range[0]), hi = static_cast<double>(range[1]);
  if (lo < p.isovalue && p.isovalue <= hi) return true;
  if (!p.cap || !(lo <= hi) || !(p.below ? lo < p.isovalue : hi >= p.isovalue)) return false;
  return p.everywhere || is_at_border(p, i);
}

/// Whether a tile is needed and the region of interest leaves it a cell.
template <class T>
__device__ bool is_active(const SearchParams& p, std::uint32_t i) {
  if (!is_needed<T>(p, i)) return false;
  if (p.uncut) return true;
#pragma unroll
  for (int axis = 0; axis < 3; ++axis) {
    const int origin = p.tiles[3 * static_cast<std::size_t>(i) + axis] * 32;
    if (::min(p.roi_hi[axis] - 1, origin + 32) <= ::max(p.roi_lo[axis], origin)) return false;
  }
  return true;
}

template <class T>
__global__ void __launch_bounds__(kSearchThreads)
    search_tiles(const __grid_constant__ SearchParams p) {
  __shared__ std::uint32_t warp_sums[kSearchWarps];
  __shared__ std::uint32_t block;
  __shared__ unsigned long long base;
  if (threadIdx.x == 0) block = atomicAdd(p.ticket, 1u);
  __syncthreads();
  const std::uint32_t first = block * kTilesOfSearchBlock + threadIdx.x * kTilesOfSearchThread;
  bool active[kTilesOfSearchThread];
  std::uint32_t own = 0;
#pragma unroll
  for (int i = 0; i < kTilesOfSearchThread; ++i) {
    active[i] = first + i < p.count && is_active<T>(p, first + i);
    own += active[i];
  }
  const std::uint32_t sum = warp_inclusive_sum(own);
  if (lane_id() == 31) warp_sums[threadIdx.x >> 5] = sum;
  __syncthreads();
  const SumOfWarps warps = sum_of_warps(warp_sums);
  if (threadIdx.x < 32) {
    if (lane_id() == 0) publish_sum(p.sums[block], block, warps.all);
    const unsigned long long before = sum_before(
        [&](std::uint32_t i) -> unsigned long long& { return p.sums[i]; }, block, warps.all);
    if (lane_id() == 0) {
      base = before;
      if ((block + 1) * kTilesOfSearchBlock >= p.count) {
        const auto found = static_cast<std::uint32_t>(before + warps.all);
        *p.found = found;
        *p.item_count = found <= p.item_room ? found : 0;
      }
    }
  }
  __syncthreads();
  auto place = static_cast<std::uint32_t>(base) + warps.before + sum - own;
#pragma unroll
  for (int i = 0; i < kTilesOfSearchThread; ++i) {
    if (first + i >= p.count) return;
    const std::int32_t* t = p.tiles + 3 * static_cast<std::size_t>(first + i);
    const std::size_t at = place_of(t, p.grid);
    p.slot_of_tile[at] = active[i] ? place : kNone;
    if (!active[i]) continue;
    p.items[place] = {t[0], t[1], t[2], place};
    p.order[place] = {0, 0};
    ++place;
  }
}

template <class T>
__global__ void __launch_bounds__(kSearchThreads)
    find_tile_ranges(const __grid_constant__ TileParams p, const std::int32_t* tiles, T* ranges) {
  __shared__ T least[kSearchWarps], most[kSearchWarps];
  const std::int32_t* t = tiles + 3 * static_cast<std::size_t>(blockIdx.x);
  ValueRange<T> range;
  for (int i = static_cast<int>(threadIdx.x); i < 33 * 33 * 33; i += kSearchThreads) {
    const int x = i % 33, y = i / 33 % 33, z = i / (33 * 33);
    if (t[0] * 32 + x >= p.extent[0] || t[1] * 32 + y >= p.extent[1] ||
        t[2] * 32 + z >= p.extent[2])
      continue;
    const std::int64_t place =
        (static_cast<std::int64_t>(t[2] + (z >> 5)) * p.tiles[1] + t[1] + (y >> 5)) * p.tiles[0] +
        t[0] + (x >> 5);
    const std::size_t block = block_of_place(p, place);
    range.include(static_cast<const T*>(
        p.tile_blocks)[block * kTileBlockSamples + ((z & 31) << 10 | (y & 31) << 5 | (x & 31))]);
  }
  const auto merge = [&](T lo, T hi) { range.include(ValueRange<T>{lo, hi}); };
#pragma unroll
  for (int d = 16; d; d /= 2)
    merge(static_cast<T>(__shfl_xor_sync(kFullMask, range.lo, d)),
          static_cast<T>(__shfl_xor_sync(kFullMask, range.hi, d)));
  if (lane_id() == 0) {
    least[threadIdx.x >> 5] = range.lo;
    most[threadIdx.x >> 5] = range.hi;
  }
  __syncthreads();
  if (threadIdx.x != 0) return;
  for (int w = 1; w < kSearchWarps; ++w) merge(least[w], most[w]);
  ranges[2 * static_cast<std::size_t>(blockIdx.x)] = range.lo;
  ranges[2 * static_cast<std::size_t>(blockIdx.x) + 1] = range.hi;
}

template <class T>
__global__ void __launch_bounds__(kSearchThreads)
    copy_first_columns(const T* tile_blocks, T* columns) {
  const std::size_t block = blockIdx.x;
  for (unsigned i = threadIdx.x; i < kColumnSamples; i += kSearchThreads)
    columns[block * kColumnSamples + i] = tile_blocks[block * kTileBlockSamples + 32 * i];
}

}  // namespace isobrick::gpu
