#pragma once

#include "gpu/tile/tile_classify.cuh"
#include "gpu/tile/tile_count.cuh"
#include "gpu/tile/tile_nan.cuh"
#include "surface/inner_vertices.h"

// Single cells of a tile and around it, for kernels that do more than the tables of cases: their
// corners, and what is noted of them.

namespace isobrick::inline v0::gpu {

__device__ inline SampleWork& sample_work(const TileParams& p) {
  return p.on_samples.work[blockIdx.x];
}
__device__ inline TrilinearWork& trilinear_work(const TileParams& p) {
  return p.trilinear.work[blockIdx.x];
}

__device__ inline std::uint32_t popc_64(unsigned long long v) {
  return static_cast<std::uint32_t>(__popc(static_cast<std::uint32_t>(v)) +
                                    __popc(static_cast<std::uint32_t>(v >> 32)));
}
__device__ inline unsigned long long bits_below(int x) { return (1ull << x) - 1; }

/// The eight bits of a cell, each coordinate in −1 … 32, from rows around the tile.
__device__ inline std::uint32_t corners_at(const unsigned long long* rows, int x, int y, int z) {
  const unsigned long long* row = rows + (z + 1) * kEdgeAround + y + 1;
  const auto pair = [&](int step) { return static_cast<std::uint32_t>(row[step] >> (x + 1)) & 3u; };
  return pair(0) | pair(1) << 2 | pair(kEdgeAround) << 4 | pair(kEdgeAround + 1) << 6;
}

/// The cells of a row that exist, as bits x + 1.
__device__ inline unsigned long long cells_there(const SampleWork& w, int y, int z) {
  return w.there[(z + 1) * kCellsAround + y + 1];
}
__device__ inline bool exists(const SampleWork& w, int x, int y, int z) {
  return (cells_there(w, y, z) >> (x + 1) & 1u) != 0;
}

/// The corners of the cell at (x, y, z), each in −1 … 32, less the isovalue.
template <class T>
__device__ inline void load_cell(const TileShared& s, const TileParams& p, int x, int y, int z,
                                 double (&d)[8]) {
  cell_topology::load_values<T>(d, p.isovalue, [&](int c) {
    const int cx = x + (c & 1), cy = y + (c >> 1 & 1), cz = z + (c >> 2);
    return __ldg(sample_at<T>(s, block_at(cx, cy, cz), cx + 32 * cy + 1024 * cz));
  });
}

/// The inside bits of the corners of the cell at `x` in the row.
__device__ inline std::uint32_t case_at(const TileShared& s, int row, int x) {
  const auto pair = [&](int step) {
    const RowBits& bits = s.rows[row + step];
    return (bits.at >> x & 1u) | (bits.next() >> x & 1u) << 1;
  };
  return pair(0) | pair(1) << 2 | pair(33) << 4 | pair(34) << 6;
}

/// As coincident::vertex_on(): the corner that is a coincident vertex, or 8 + edge.
__device__ inline std::uint32_t vertex_on(std::uint32_t edge, std::uint32_t at) {
  const std::uint32_t axis = edge >> 2, i = edge & 1u, j = edge >> 1 & 1u;
  const std::uint32_t low = axis == 0 ? i << 1 | j << 2 : axis == 1 ? i | j << 2 : i | j << 1;
  const std::uint32_t high = low | 1u << axis;
  return at >> low & 1u ? low : at >> high & 1u ? high : 8u + edge;
}

/// Triangles of a cell that are kept, and the corners that they have vertices on, as bits.
struct KeptOfCell {
  std::uint32_t triangles = 0, corners = 0;

  /// Triangle t with vertices as vertex_on() names them.
  __device__ void add(std::uint32_t t, std::uint32_t a, std::uint32_t b, std::uint32_t c) {
    if (a == b || b == c || c == a) return;
    triangles |= 1u << t;
    const auto bit = [](std::uint32_t vertex) { return vertex < 8 ? 1u << vertex : 0u; };
    corners |= bit(a) | bit(b) | bit(c);
  }
};

/// Marks the corners of a cell that triangles have vertices on.
__device__ inline void mark_corners_of(SampleWork& w, int row, int x, std::uint32_t corners) {
#pragma unroll
  for (int pair = 0; pair < 4; ++pair)
    if (const unsigned long long two = corners >> 2 * pair & 3u)
      atomicOr(&w.used[row + (pair & 1) + 33 * (pair >> 1)], two << x);
}

/// Marks the corners of a row's cells that triangles have vertices on. Whole warps, a cell a
/// thread.
__device__ inline void mark_corners(SampleWork& w, int row, std::uint32_t corners) {
#pragma unroll
  for (int pair = 0; pair < 4; ++pair) {
    const std::uint32_t low = __ballot_sync(kFullMask, (corners >> 2 * pair & 1u) != 0),
                        high = __ballot_sync(kFullMask, (corners >> 2 * pair & 2u) != 0);
    if (lane_id() == 0 && (low | high) != 0)
      atomicOr(&w.used[row + (pair & 1) + 33 * (pair >> 1)],
               low | static_cast<unsigned long long>(high) << 1);
  }
}

/// Replaces each row's count by that of the rows before; the count of all. One warp.
template <class Int>
__device__ inline std::uint32_t sum_rows(Int (&counts)[kRowsOfTile]) {
  constexpr int kEach = 35;
  static_assert(32 * kEach >= kRowsOfTile);
  const int begin = static_cast<int>(lane_id()) * kEach, end = ::min(begin + kEach, kRowsOfTile);
  std::uint32_t own = 0;
  for (int row = begin; row < end; ++row) own += counts[row];
  const std::uint32_t sum = warp_inclusive_sum(own);
  std::uint32_t before = sum - own;
  for (int row = begin; row < end; ++row) {
    const std::uint32_t count = counts[row];
    counts[row] = static_cast<Int>(before);
    before += count;
  }
  return __shfl_sync(kFullMask, sum, 31);
}

/// Which of a mask's bits is number `n`, counted from 0.
__device__ inline int bit_number(unsigned long long mask, std::uint32_t n) {
  int bit = 0;
#pragma unroll
  for (int half = 32; half > 0; half /= 2) {
    const std::uint32_t below = popc_64(mask & bits_below(half));
    if (n < below) continue;
    n -= below;
    mask >>= half;
    bit += half;
  }
  return bit;
}

/// Calls f(group, exists, row, bit) for the bits of rows, 32 a warp, however they lie in rows. All
/// threads of a warp come along; `exists` is false for those without a bit. `before`: bits in the
/// rows before (sum_rows), and `all` of them.
template <int N, class Mask, class F>
__device__ inline void for_each_bit(const Mask (&masks)[kRowsOfTile],
                                    const std::uint32_t (&before)[kRowsOfTile], std::uint32_t all,
                                    F&& f) {
  for (std::uint32_t first = 32 * warp_id(); first < all; first += N) {
    const std::uint32_t number = first + lane_id();
    int row = 0;
    // The last row with no more bits before it.
    for (int step = 1024; step > 0; step /= 2)
      if (row + step < kRowsOfTile && before[row + step] <= number) row += step;
    const bool exists = number < all;
    f(first / 32, exists, row, exists ? bit_number(masks[row], number - before[row]) : 0);
    __syncwarp();
  }
}

}  // namespace isobrick::gpu
