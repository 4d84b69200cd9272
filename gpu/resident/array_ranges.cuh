#pragma once

#include <isobrick/range.h>
#include "gpu/resident/array_tiles.cuh"

// The kernels that find the ranges of the tiles of an array, reading each sample once.

namespace isobrick::inline v0::gpu {

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

/// The range of narrow integers that come in words: two at a time, with three operands where the
/// device has such instructions. Signed ones are turned into unsigned ones of the same order.
template <class T>
struct WordRange {
  static constexpr bool kBytes = sizeof(T) == 1;
  static constexpr std::uint32_t kTurn = !std::is_signed_v<T> ? 0
                                         : kBytes             ? 0x80808080u
                                                              : 0x80008000u;
  std::uint32_t lo = ~0u, hi = 0;  ///< of the upper and of the lower halves

  __device__ void include(std::uint32_t a, std::uint32_t b) {
    lo = __vimin3_u16x2(lo, a, b);
    hi = __vimax3_u16x2(hi, a, b);
  }
  __device__ void include(uint4 v) {
    const std::uint32_t words[4] = {v.x ^ kTurn, v.y ^ kTurn, v.z ^ kTurn, v.w ^ kTurn};
    if constexpr (kBytes) {
#pragma unroll
      for (const std::uint32_t w : words) include(w & 0x00ff00ffu, w >> 8 & 0x00ff00ffu);
    } else {
      include(words[0], words[1]);
      include(words[2], words[3]);
    }
  }
  __device__ ValueRange<T> range() const {
    if (lo == ~0u && hi == 0) return {};  // of no sample
    const auto value = [](std::uint32_t v) {
      return static_cast<T>(v ^ (kBytes ? kTurn & 0xffu : kTurn & 0xffffu));
    };
    return {value(::min(lo & 0xffffu, lo >> 16)), value(::max(hi & 0xffffu, hi >> 16))};
  }
};

/// The samples of a tile at x = 0.
template <class T>
using FirstColumn = T[32][32];  // [z, y]

/// Reads a tile.
template <class T, ArrayOrder Order>
__device__ inline SeenSamples<T> look_at_tile(const ArrayTile<T>& tile, FirstColumn<T>& column) {
  SeenSamples<T> seen;
  if constexpr (is_turned(Order)) {
    constexpr int kFast = fast_axis(Order);
    for_each_turned<kFast>(tile, 0, 32, [&](T v, int x, int fast, int slow) {
      seen.include(v);
      if (x == 0) (kFast == 1 ? column[slow][fast] : column[fast][slow]) = v;
    });
  } else if (Order == ArrayOrder::vectors && tile.extent[0] == 32) {
    [[maybe_unused]] WordRange<T> narrow;
    for_each_vector(tile, [&](const ArrayVector<T>& vector, int row, int x) {
      if (x == 0) column[row / 32][row % 32] = vector.samples[0];
      if constexpr (sizeof(T) <= 2)
        narrow.include(vector.words);
      else
#pragma unroll
        for (const T v : vector.samples) seen.include(v);
    });
    if constexpr (sizeof(T) <= 2) seen.range = narrow.range();
  } else {
    for_each_in_rows(tile, [&](T v, int row, int x) {
      seen.include(v);
      if (x == 0) column[row / 32][row % 32] = v;
    });
  }
  return seen;
}

/// The range of all lanes.
template <class T>
__device__ inline ValueRange<T> range_of_warp(ValueRange<T> range) {
#pragma unroll
  for (int d = 16; d; d /= 2)
    range.include(ValueRange<T>{static_cast<T>(__shfl_xor_sync(kFullMask, range.lo, d)),
                                static_cast<T>(__shfl_xor_sync(kFullMask, range.hi, d))});
  return range;
}

/// What a lane sees of a lower plane, edge or the corner of a tile: `part` of
/// ArrayRangeParams::part_ranges.
template <class T>
__device__ inline ValueRange<T> lower_part(const ArrayTile<T>& tile, const FirstColumn<T>& column,
                                           unsigned part) {
  const int lane = static_cast<int>(lane_id());
  // The axes that the part goes along; along the others it is 0.
  const bool along_x = !(part & 1), along_y = !(part & 2), along_z = !(part & 4);
  const int inner = along_x ? 0 : along_y ? 1 : 2, outer = along_z ? 2 : 1;
  const bool is_plane = along_x + along_y + along_z == 2;
  ValueRange<T> range;
  if (part == 7 ? lane > 0 : !tile.has(inner, lane)) return range;
  const std::int64_t of_column[3] = {0, 1, 32};
  const std::int64_t* const step = along_x ? tile.step : of_column;
  const T* from = (along_x ? tile.from : &column[0][0]) + lane * step[inner];
  const int count = is_plane ? tile.extent[outer] : 1;
#pragma unroll 8
  for (int i = 0; i < count; ++i, from += step[outer]) range.include(*from);
  return range;
}

/// A tile a thread block.
template <class T, ArrayOrder Order>
__global__ void __launch_bounds__(kArrayThreads)
    find_part_ranges(const __grid_constant__ ArrayRangeParams p) {
  static_assert(kArrayWarps == 8, "a warp for each part");
  __shared__ T least[kArrayWarps], most[kArrayWarps];
  __shared__ FirstColumn<T> column;
  const ArrayTile<T> tile = ArrayTile<T>::of(p.array, blockIdx.x);
  const SeenSamples<T> seen = look_at_tile<T, Order>(tile, column);
  if (seen.nan) *p.found_nan = 1;
  const unsigned warp = threadIdx.x / 32;
  const ValueRange<T> all = range_of_warp(seen.range);
  if (lane_id() == 0) {
    least[warp] = all.lo;
    most[warp] = all.hi;
  }
  __syncthreads();
  ValueRange<T> range;
  if (warp == 0)
    range = {least[lane_id() % kArrayWarps], most[lane_id() % kArrayWarps]};
  else
    range = lower_part(tile, column, warp);
  range = range_of_warp(range);
  if (lane_id() == 0)
    static_cast<ValueRange<T>*>(p.part_ranges)[8 * static_cast<std::size_t>(blockIdx.x) + warp] =
        range;
}

/// A tile a thread: joins the ranges of the parts that its cells touch.
template <class T>
__global__ void __launch_bounds__(kArrayThreads)
    join_part_ranges(const __grid_constant__ ArrayRangeParams p) {
  const std::uint32_t i = blockIdx.x * kArrayThreads + threadIdx.x;
  if (i >= p.count) return;
  const std::int32_t* t = p.order + 3 * static_cast<std::size_t>(i);
  const auto* parts = static_cast<const ValueRange<T>*>(p.part_ranges);
  ValueRange<T> range;
  for (int part = 0; part < 8; ++part) {
    const int x = t[0] + (part & 1), y = t[1] + (part >> 1 & 1), z = t[2] + (part >> 2);
    if (x >= p.array.tiles[0] || y >= p.array.tiles[1] || z >= p.array.tiles[2]) continue;
    const std::size_t place =
        (static_cast<std::size_t>(z) * p.array.tiles[1] + y) * p.array.tiles[0] + x;
    range.include(parts[8 * place + part]);
  }
  static_cast<T*>(p.ranges)[2 * static_cast<std::size_t>(i)] = range.lo;
  static_cast<T*>(p.ranges)[2 * static_cast<std::size_t>(i) + 1] = range.hi;
}

}  // namespace isobrick::gpu
