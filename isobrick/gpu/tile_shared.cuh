#pragma once

#include <cstddef>
#include <cstdint>

#include "isobrick/gpu/tile_params.h"

// How a block of threads works on one tile; docs/gpu.md has the whole picture.

namespace isobrick::gpu {

/// Vertices or cells that are found at a time; tiles with more take several turns.
inline constexpr std::uint32_t kListed = 2560;
inline constexpr unsigned kAll = 0xffffffffu;

/// How many threads share a tile, and how its rows are dealt out to them.
template <int N>
struct Team {
  static constexpr int kThreads = N, kWarps = N / 32;
  static constexpr int kSteps = (kRowsOfTile + N - 1) / N;
};

/// A row of inside bits: samples 0 … 31, and samples 1 … 32.
struct RowBits {
  std::uint32_t at, next;
};

/// Where the vertex of a cell's edge is found, as byte offsets from the row of
/// the cell: two words whose difference marks the row's crossing edges, the
/// number of the first of them, and by how much the mask of earlier ones shifts.
struct EdgePlace {
  std::uint32_t first_word, second_word, number, shift;
};

struct TileShared {
  RowBits rows[kRowsOfTile];
  std::uint32_t x_base[kRowsOfTile], y_base[kRowsOfTile], z_base[kRowsOfTile];
  std::uint16_t cell_base[kRowsOfTile + 1];
  union {
    alignas(16) std::uint16_t vertex_marks[kListed];  ///< row + 1 where a row's vertices begin
    struct {
      std::uint32_t y_at_0[kRowsOfTile], z_at_0[kRowsOfTile];
    };
  };
  /// Row + 1 where a row's cells begin, else 0; then x | row << 5 | case << 16.
  alignas(16) std::uint32_t cells[kListed];
  /// The rows that the first of each 32 vertices and cells lie in.
  std::uint16_t vertex_rows[kListed / 32], cell_rows[kListed / 32];
  /// Three edges of 4 bits a triangle, and in the upper bits of a case's first
  /// entry how many triangles it has.
  std::uint16_t triangles[256 * 5];
  alignas(16) EdgePlace places[2][12];              ///< of cells with x > 0, of those with x = 0
  const void* pages[27];                            ///< of the tiles around, x + 3·y + 9·z
  std::uint32_t step_sums[64];                      ///< of 32 rows each: vertices | cells << 16
  std::uint32_t step_vertices[64], step_cells[64];  ///< before them
  std::uint32_t all_vertices, all_cells;
  std::uint32_t warp_triangles[32];
  unsigned long long vertex_base, triangle_base;
  std::uint32_t neighbour_base[8];  ///< bit set: one tile lower along that axis
  const RowTable* neighbour[8];
  std::uint32_t item;
};

/// What each warp has for itself, after TileShared.
struct WarpShared {
  std::uint32_t staging[96];
  /// Triangles not yet written, cell | triangle << 12, in a ring: fewer than 32
  /// wait while those of 32 cells come.
  static constexpr std::uint32_t kRing = 256;
  std::uint16_t pending[kRing];
};

/// A tile cut to the region of interest; see TileShape of the CPU.
struct Shape {
  int origin[3], lo[3], hi[3];
  bool first[3], empty;
  std::uint32_t cell_mask, sample_mask;  ///< bits of x words; of y and z words
  std::uint32_t at_0;                    ///< 1 where the tile owns edges at sample 0
};

__device__ inline std::uint32_t z_of_row(std::uint32_t row) { return row * 1986u >> 16; }
__device__ inline unsigned warp_id() { return threadIdx.x >> 5; }
__device__ inline unsigned lane_id() { return threadIdx.x & 31u; }
__device__ inline std::uint32_t lanes_below() { return (1u << lane_id()) - 1u; }

__device__ inline std::uint32_t warp_sum(std::uint32_t v) {
#if __CUDA_ARCH__ >= 800
  return __reduce_add_sync(kAll, v);
#else
#pragma unroll
  for (int d = 16; d; d /= 2) v += __shfl_xor_sync(kAll, v, d);
  return v;
#endif
}

__device__ inline std::uint32_t warp_inclusive_sum(std::uint32_t v) {
#pragma unroll
  for (int d = 1; d < 32; d *= 2) {
    const std::uint32_t below = __shfl_up_sync(kAll, v, d);
    if (lane_id() >= d) v += below;
  }
  return v;
}

/// Bits lo … hi of the 33 samples of a row.
__device__ inline unsigned long long bit_span(int lo, int hi) {
  return (2ull << hi) - (1ull << lo);
}

__device__ inline Shape shape_of(const TileParams& p, const TileItem& item) {
  Shape s;
  const int tile[3] = {item.x, item.y, item.z};
  s.empty = false;
#pragma unroll
  for (int axis = 0; axis < 3; ++axis) {
    s.origin[axis] = tile[axis] * 32;
    s.lo[axis] = ::max(p.roi_lo[axis] - s.origin[axis], 0);
    s.hi[axis] = ::min(p.roi_hi[axis] - 1 - s.origin[axis], 32);
    s.first[axis] = tile[axis] == p.roi_lo[axis] / 32;
    s.empty = s.empty || s.hi[axis] <= s.lo[axis];
  }
  s.cell_mask = s.empty ? 0 : static_cast<std::uint32_t>(bit_span(s.lo[0], s.hi[0] - 1));
  s.sample_mask = s.empty ? 0 : static_cast<std::uint32_t>(bit_span(s.lo[0], s.hi[0]) >> 1);
  s.at_0 = s.first[0] && s.lo[0] == 0 ? 1u : 0u;
  return s;
}

}  // namespace isobrick::gpu
