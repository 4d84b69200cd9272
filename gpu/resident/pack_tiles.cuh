#pragma once

#include <isobrick/range.h>
#include "gpu/resident/pack_params.h"
#include "gpu/tile/tile_params.h"
#include "gpu/tile/tile_place.cuh"

// The kernels that copy an array of any strides to tile blocks, reading each sample once, and find
// the ranges of the tiles.

namespace isobrick::inline v0::gpu {

inline constexpr int kPackThreads = 256, kPackWarps = kPackThreads / 32;

/// Where a tile comes from and goes to.
template <class T>
struct PackedTile {
  const T* from;         ///< its sample (0, 0, 0)
  std::int64_t step[3];  ///< in `from`
  int extent[3];         ///< samples of it that exist, at most 32
  T* block;
  T* columns;
  std::size_t place;  ///< in C order

  __device__ static PackedTile of(const PackParams& p, std::uint32_t number) {
    PackedTile tile;
    const std::int32_t* t = p.order + 3 * static_cast<std::size_t>(number);
    tile.from = static_cast<const T*>(p.samples);
#pragma unroll
    for (int axis = 0; axis < 3; ++axis) {
      tile.step[axis] = p.strides[axis];
      tile.from += 32 * static_cast<std::int64_t>(t[axis]) * p.strides[axis];
      tile.extent[axis] = ::min(32, p.extent[axis] - 32 * t[axis]);
    }
    tile.place = (static_cast<std::size_t>(t[2]) * p.tiles[1] + t[1]) * p.tiles[0] + t[0];
    tile.block = static_cast<T*>(p.tile_blocks) + (tile.place + 1) * kTileBlockSamples;
    tile.columns = static_cast<T*>(p.columns) + (tile.place + 1) * kColumnSamples;
    return tile;
  }

  __device__ bool has(int axis, int at) const { return at < extent[axis]; }
  __device__ T read(int x, int y, int z) const {
    return __ldg(from + x * step[0] + y * step[1] + z * step[2]);
  }
};

/// What a thread has seen.
template <class T>
struct SeenSamples {
  ValueRange<T> range;
  bool nan = false;

  __device__ void include(T v) {
    range.include(v);
    if constexpr (std::is_floating_point_v<T>) nan = nan || v != v;
  }
};

/// 16 bytes a thread.
template <class T>
__device__ inline void copy_vectors(const PackedTile<T>& tile, SeenSamples<T>& seen) {
  constexpr int kSamples = 16 / static_cast<int>(sizeof(T)), kOfRow = 32 / kSamples;
#pragma unroll 4
  for (int i = static_cast<int>(threadIdx.x); i < 1024 * kOfRow; i += kPackThreads) {
    const int row = i / kOfRow, x = i % kOfRow * kSamples, y = row % 32, z = row / 32;
    if (!tile.has(1, y) || !tile.has(2, z)) continue;
    union {
      uint4 vector;
      T samples[kSamples];
    } part;
    part.vector =
        __ldcs(reinterpret_cast<const uint4*>(tile.from + x + y * tile.step[1] + z * tile.step[2]));
#pragma unroll
    for (int k = 0; k < kSamples; ++k) seen.include(part.samples[k]);
    reinterpret_cast<uint4*>(tile.block)[i] = part.vector;
    if (x == 0) tile.columns[row] = part.samples[0];
  }
}

/// A sample a thread, a row a warp.
template <class T>
__device__ inline void copy_rows(const PackedTile<T>& tile, SeenSamples<T>& seen) {
  const int x = static_cast<int>(threadIdx.x % 32);
#pragma unroll 4
  for (int row = static_cast<int>(threadIdx.x / 32); row < 1024; row += kPackWarps) {
    const int y = row % 32, z = row / 32;
    if (!tile.has(0, x) || !tile.has(1, y) || !tile.has(2, z)) continue;
    const T v = tile.read(x, y, z);
    seen.include(v);
    tile.block[32 * row + x] = v;
    if (x == 0) tile.columns[row] = v;
  }
}

/// Neighbours along `Fast`, 1 or 2, are near each other: planes of 32² pass through shared memory.
template <int Fast, class T>
__device__ inline void copy_turned(const PackedTile<T>& tile, SeenSamples<T>& seen) {
  __shared__ T plane[32][33];  // [fast, x]
  constexpr int kSlow = 3 - Fast;
  const int lane = static_cast<int>(threadIdx.x % 32), warp = static_cast<int>(threadIdx.x / 32);
  for (int slow = 0; slow < tile.extent[kSlow]; ++slow) {
    for (int x = warp; x < tile.extent[0]; x += kPackWarps) {
      if (!tile.has(Fast, lane)) continue;
      const T v = Fast == 1 ? tile.read(x, lane, slow) : tile.read(x, slow, lane);
      seen.include(v);
      plane[lane][x] = v;
    }
    __syncthreads();
    for (int fast = warp; fast < tile.extent[Fast]; fast += kPackWarps) {
      if (!tile.has(0, lane)) continue;
      const int row = Fast == 1 ? 32 * slow + fast : 32 * fast + slow;
      const T v = plane[fast][lane];
      tile.block[32 * row + lane] = v;
      if (lane == 0) tile.columns[row] = v;
    }
    __syncthreads();
  }
}

/// The ranges of the tile's lower planes, edges and corner, from the block.
template <class T>
__device__ inline void look_at_lower_planes(const PackedTile<T>& tile, ValueRange<T> (&parts)[8]) {
  for (int i = static_cast<int>(threadIdx.x); i < 1024; i += kPackThreads) {
    const int a = i % 32, b = i / 32;
    const auto take = [&](int part, int axis_a, int axis_b, int step_a, int step_b) {
      if (!tile.has(axis_a, a) || !tile.has(axis_b, b)) return;
      const T v = tile.block[a * step_a + b * step_b];
      parts[part].include(v);
      if (a == 0) parts[part | 1 << axis_a].include(v);
      if (b == 0) parts[part | 1 << axis_b].include(v);
      if (a == 0 && b == 0) parts[7].include(v);
    };
    take(1, 1, 2, 32, 1024);
    take(2, 0, 2, 1, 1024);
    take(4, 0, 1, 1, 32);
  }
}

/// The ranges of all threads, in the first.
template <class T>
__device__ inline void merge_ranges(ValueRange<T> (&parts)[8]) {
  __shared__ T least[8][kPackWarps], most[8][kPackWarps];
#pragma unroll
  for (int part = 0; part < 8; ++part) {
    ValueRange<T>& range = parts[part];
#pragma unroll
    for (int d = 16; d; d /= 2)
      range.include(ValueRange<T>{static_cast<T>(__shfl_xor_sync(kFullMask, range.lo, d)),
                                  static_cast<T>(__shfl_xor_sync(kFullMask, range.hi, d))});
    if (lane_id() == 0) {
      least[part][threadIdx.x / 32] = range.lo;
      most[part][threadIdx.x / 32] = range.hi;
    }
  }
  __syncthreads();
  if (threadIdx.x != 0) return;
  for (int part = 0; part < 8; ++part)
    for (int warp = 1; warp < kPackWarps; ++warp)
      parts[part].include(ValueRange<T>{least[part][warp], most[part][warp]});
}

template <class T, PackOrder Order>
__global__ void __launch_bounds__(kPackThreads) pack_tiles(const __grid_constant__ PackParams p) {
  const PackedTile<T> tile = PackedTile<T>::of(p, blockIdx.x);
  SeenSamples<T> seen;
  if constexpr (Order == PackOrder::along_y || Order == PackOrder::along_z)
    copy_turned<Order == PackOrder::along_y ? 1 : 2>(tile, seen);
  else if (Order == PackOrder::vectors && tile.extent[0] == 32)
    copy_vectors(tile, seen);
  else
    copy_rows(tile, seen);
  ValueRange<T> parts[8];
  parts[0] = seen.range;
  if (seen.nan) *p.found_nan = 1;
  __syncthreads();  // the block is whole
  look_at_lower_planes(tile, parts);
  merge_ranges(parts);
  if (threadIdx.x != 0) return;
  auto* const ranges = static_cast<ValueRange<T>*>(p.part_ranges) + 8 * tile.place;
  for (int part = 0; part < 8; ++part) ranges[part] = parts[part];
}

/// A tile a thread.
template <class T>
__global__ void __launch_bounds__(kPackThreads)
    join_part_ranges(const __grid_constant__ PackParams p) {
  const std::uint32_t i = blockIdx.x * kPackThreads + threadIdx.x;
  if (i >= p.count) return;
  const std::int32_t* t = p.order + 3 * static_cast<std::size_t>(i);
  const auto* parts = static_cast<const ValueRange<T>*>(p.part_ranges);
  ValueRange<T> range;
  for (int part = 0; part < 8; ++part) {
    const int x = t[0] + (part & 1), y = t[1] + (part >> 1 & 1), z = t[2] + (part >> 2);
    if (x >= p.tiles[0] || y >= p.tiles[1] || z >= p.tiles[2]) continue;
    const std::size_t place = (static_cast<std::size_t>(z) * p.tiles[1] + y) * p.tiles[0] + x;
    range.include(parts[8 * place + part]);
  }
  static_cast<T*>(p.ranges)[2 * static_cast<std::size_t>(i)] = range.lo;
  static_cast<T*>(p.ranges)[2 * static_cast<std::size_t>(i) + 1] = range.hi;
}

}  // namespace isobrick::gpu
