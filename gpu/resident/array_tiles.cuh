#pragma once

#include "gpu/resident/array_params.h"
#include "gpu/tile/tile_place.cuh"

// Tiles of an array of any strides.

namespace isobrick::inline v0::gpu {

inline constexpr int kArrayThreads = 256, kArrayWarps = kArrayThreads / 32;

/// Where the samples of a tile lie.
template <class T>
struct ArrayTile {
  const T* from;         ///< its sample (0, 0, 0)
  std::int64_t step[3];  ///< in `from`
  int extent[3];         ///< samples of it that exist, at most 32

  /// The tile at `place` in C order.
  __device__ static ArrayTile of(const ArrayParams& p, std::uint32_t place) {
    const std::uint32_t row = place / p.tiles[0];
    const int t[3] = {static_cast<int>(place % p.tiles[0]), static_cast<int>(row % p.tiles[1]),
                      static_cast<int>(row / p.tiles[1])};
    ArrayTile tile;
    tile.from = static_cast<const T*>(p.samples);
#pragma unroll
    for (int axis = 0; axis < 3; ++axis) {
      tile.step[axis] = p.strides[axis];
      tile.from += 32 * static_cast<std::int64_t>(t[axis]) * p.strides[axis];
      tile.extent[axis] = ::min(32, p.extent[axis] - 32 * t[axis]);
    }
    return tile;
  }

  __device__ bool has(int axis, int at) const { return at < extent[axis]; }
};

/// 16 bytes of a row.
template <class T>
union ArrayVector {
  static constexpr int kSamples = 16 / static_cast<int>(sizeof(T));
  uint4 words;
  T samples[kSamples];
};

// The loops below add to addresses: multiplying would take more time than reading.

/// Calls f(vector, row, x) for the vectors of a tile's rows, one a thread; its rows are whole.
template <class T, class F>
__device__ inline void for_each_vector(const ArrayTile<T>& tile, F&& f) {
  constexpr int kSamples = ArrayVector<T>::kSamples, kOfRow = 32 / kSamples;
  constexpr int kRows = kArrayThreads / kOfRow, kY = kRows < 32 ? kRows : 32, kZ = kRows / kY;
  const int t = static_cast<int>(threadIdx.x), x = t % kOfRow * kSamples;
#pragma unroll
  for (int y = t / kOfRow % 32; y < 32; y += kY) {
    if (!tile.has(1, y)) continue;
    int z = t / kOfRow / 32;
    const T* from = tile.from + x + y * tile.step[1] + z * tile.step[2];
#pragma unroll 8
    for (; z < tile.extent[2]; z += kZ, from += kZ * tile.step[2]) {
      ArrayVector<T> vector;
      vector.words = __ldg(reinterpret_cast<const uint4*>(from));
      f(vector, y + 32 * z, x);
    }
  }
}

/// Calls f(sample, row, x) for the samples of a tile, a row a warp.
template <class T, class F>
__device__ inline void for_each_in_rows(const ArrayTile<T>& tile, F&& f) {
  const int x = static_cast<int>(threadIdx.x % 32);
  if (!tile.has(0, x)) return;
  for (int y = static_cast<int>(threadIdx.x / 32); y < tile.extent[1]; y += kArrayWarps) {
    const T* from = tile.from + x * tile.step[0] + y * tile.step[1];
#pragma unroll 8
    for (int z = 0; z < tile.extent[2]; ++z, from += tile.step[2]) f(__ldg(from), y + 32 * z, x);
  }
}

/// Calls f(sample, x, fast, slow) for so many planes of a tile from `first` on along the third
/// axis. Neighbouring threads are neighbours along `Fast`, 1 or 2.
template <int Fast, class T, class F>
__device__ inline void for_each_turned(const ArrayTile<T>& tile, int first, int planes, F&& f) {
  constexpr int kSlow = 3 - Fast;
  const int fast = static_cast<int>(threadIdx.x % 32);
  const int end = ::min(first + planes, tile.extent[kSlow]);
  if (!tile.has(Fast, fast)) return;
  for (int x = static_cast<int>(threadIdx.x / 32); x < tile.extent[0]; x += kArrayWarps) {
    const T* from =
        tile.from + x * tile.step[0] + fast * tile.step[Fast] + first * tile.step[kSlow];
#pragma unroll 8
    for (int slow = first; slow < end; ++slow, from += tile.step[kSlow])
      f(__ldg(from), x, fast, slow);
  }
}

/// The axis along which neighbouring threads read, in the orders that are turned.
constexpr int fast_axis(ArrayOrder order) { return order == ArrayOrder::along_y ? 1 : 2; }
constexpr bool is_turned(ArrayOrder order) {
  return order == ArrayOrder::along_y || order == ArrayOrder::along_z;
}

}  // namespace isobrick::gpu
