#pragma once

#include <cstddef>
#include <cstdint>

#include "gpu/tile/ptx.cuh"
#include "gpu/tile/tile_params.h"

// How a block of threads works on one tile; docs/design/gpu.md has the whole picture.

namespace isobrick::inline v0::gpu {

inline constexpr unsigned kFullMask = 0xffffffffu;
/// What lies between the words of a row along x, y and z. The cells of a warp lie in rows
/// close to each other: like this, the three are in different banks.
inline constexpr int kRowPitch = kRowsOfTile + 10;
static_assert(kRowPitch % 32 == 11);

/// Rows are dealt out to warps in groups of up to 32 (tile_row_groups.cuh).
inline constexpr int kRowGroups = 33 + 2;

/// A block of N threads that makes the mesh of one tile at a time.
template <int N>
struct BlockConfig {
  static constexpr int kWarps = N / 32;
  /// The warps that wait for other tiles: one for where vertices go and the numbers of the
  /// neighbours' vertices, one for where triangles go.
  static constexpr unsigned kVertices = 0, kTriangles = kWarps > 1 ? 1 : 0;
  /// Blocks that a multiprocessor has room for.
  static constexpr int kBlocks = N <= 384 ? 3 : N <= 640 ? 2 : 1;
  /// Vertices or cells that are listed at a time; tiles with more take several rounds.
  /// A multiprocessor before Ampere has 64 KiB of shared memory.
  static constexpr std::uint32_t kMaxListed = kBlocks == 3 ? 3360 : 7168;
};
inline constexpr std::uint32_t kListedBeforeAmpere = 512;
template <int N>
__host__ __device__ constexpr std::uint32_t listed_at_a_time() {
#if defined(__CUDA_ARCH__) && __CUDA_ARCH__ < 800
  return kListedBeforeAmpere;
#else
  return BlockConfig<N>::kMaxListed;
#endif
}
/// A row of inside bits: samples 0 … 31, and sample 32 in the lowest bit.
struct RowBits {
  std::uint32_t at, last;

  /// Samples 1 … 32.
  __device__ std::uint32_t next() const { return __funnelshift_r(at, last, 1); }
};

/// Where the number of the vertex on an edge of a cell is found: in which word of
/// TileShared::edge_bits for a cell in row 0, as bytes, and what else is added.
struct EdgePlace {
  std::uint32_t offset, addend;
};

/// A tile cut to the region of interest; see TileShape of the CPU.
struct Shape {
  int origin[3], lo[3], hi[3];
  bool first[3], empty;
  std::uint32_t cell_mask, sample_mask;  ///< bits of x words; of y and z words
  std::uint32_t at_0;                    ///< 1 where the tile owns edges at sample 0
  bool inner;                            ///< nothing is cut along y or z, and at_0 is 0
};

/// What a tile needs of the row tables of the tiles below; 0 where there is none.
struct LowerRows {
  std::uint32_t y[33], xy[33], z[33], xz[33], yz;
};

/// Where warps wait for some of the others (tile_barrier.cuh).
struct WarpBarriers {
  unsigned long long vertex_base, cells, neighbours;
  std::uint32_t turn;  ///< of the tile that is worked on, if it needs them
};

/// Numbers of vertices count from the tile's first one.
struct alignas(256) TileShared {
  RowBits rows[kRowsOfTile];
  /// The active edges of each row along x, y and z, the tile's own and those of
  /// lower tiles, and the number of the first. Bit x stands for the edge between
  /// samples x and x + 1 along x, for the one at sample x + 1 along y and z.
  std::uint32_t edge_bits[3][kRowPitch], number[3][kRowPitch];
  union {
    std::uint32_t active_cells[kRowsOfTile];  ///< cells with corners on both sides
    alignas(16) RowTable before_copy;
  };
  std::uint16_t cell_base[kRowsOfTile + 1];
  /// Numbers of the vertices at sample 0 on edges along y and along z.
  std::uint32_t at_0[2][kRowPitch];
  CaseTable cases;
  alignas(256) EdgePlace places[2][16];  ///< of cells with x > 0, of those with x = 0
  /// Of the tiles around, x + 3·y + 9·z, where their sample (0, 0, 0) of this tile's
  /// coordinates would be.
  std::uintptr_t tile_blocks[27];
  /// Of the tiles one higher along x, y + 2·z: where their sample (32, 0, 0) of this tile's
  /// coordinates would be in their first column (column_at).
  std::uintptr_t columns[4];
  /// Of each plane's first 32 rows and of its last: vertices | cells << 16.
  std::uint32_t plane_sums[33], last_row_sums[33];
  std::uint32_t all_vertices, all_cells;  ///< on edges; that are listed
  std::uint32_t extra_vertices;           ///< own ones on samples or within cells
  unsigned long long vertex_base, triangle_base;
  std::uint32_t number_base;        ///< mesh number of the tile's first vertex
  std::uint32_t neighbour_base[8];  ///< bit set: one tile lower along that axis
  LowerRows lower;
  /// Active edges at sample 0 of the lower planes: along z at y = 0, along y at z = 0.
  std::uint8_t plane_at_0[2][33];
  const RowTable* before;  ///< of the tile one lower along x, or null
  std::uint32_t item;      ///< the number of the tile that is worked on
  std::uint32_t items;     ///< how many there are
  std::uint32_t all_triangles;
  std::uint32_t next_cells, next_vertices;  ///< groups of 32 that a warp has taken
  WarpBarriers barriers;
  std::uint32_t done_before;  ///< blocks that were done before this one
  TileItem tile;
  Shape shape;
};

/// The row that the first of 32 listed things lies in, and how many of the row
/// come before it.
struct FirstOfGroup {
  std::uint16_t row, before;
};

/// The vertices and cells that are listed now, behind everything else.
template <std::uint32_t Listed>
struct alignas(16) Lists {
  static constexpr std::uint32_t kListed = Listed;
  /// Row + 1 where a row's cells begin, else 0; then x | row << 5 | case << 16 | triangles
  /// of its group before it << 24.
  std::uint32_t cells[Listed];
  std::uint16_t vertex_marks[Listed];  ///< row + 1 where a row's vertices begin
  FirstOfGroup vertex_groups[Listed / 32], cell_groups[Listed / 32];
  std::uint16_t group_triangles[Listed / 32];  ///< of 32 listed cells each
};
template <int N>
using ListsOf = Lists<listed_at_a_time<N>()>;
template <int N>
__device__ inline ListsOf<N>& lists_of(TileShared& s) {
  return *reinterpret_cast<ListsOf<N>*>(&s + 1);
}

__device__ inline std::uint32_t z_of_row(std::uint32_t row) { return row * 1986u >> 16; }
__device__ inline unsigned warp_id() { return threadIdx.x >> 5; }

/// What all threads of a warp have alike, so that the compiler knows it too: loops
/// and branches on it then need no care for threads that part.
__device__ inline std::uint32_t uniform(std::uint32_t v) { return __shfl_sync(kFullMask, v, 0); }
__device__ inline unsigned lane_id() { return threadIdx.x & 31u; }
__device__ inline std::uint32_t lanes_below() { return (1u << lane_id()) - 1u; }
/// The value of this thread, which the compiler then keeps in a register instead of finding it
/// again in each turn of a loop. Whole warps.
__device__ inline std::uint32_t kept(std::uint32_t v) {
  return __shfl_sync(kFullMask, v, lane_id());
}
template <class T>
__device__ inline T* kept(T* p) {
  return reinterpret_cast<T*>(
      __shfl_sync(kFullMask, reinterpret_cast<unsigned long long>(p), lane_id()));
}

__device__ inline std::uint32_t warp_sum(std::uint32_t v) {
#if __CUDA_ARCH__ >= 800
  return __reduce_add_sync(kFullMask, v);
#else
#pragma unroll
  for (int d = 16; d; d /= 2) v += __shfl_xor_sync(kFullMask, v, d);
  return v;
#endif
}

__device__ inline std::uint32_t warp_inclusive_sum(std::uint32_t v) {
#pragma unroll
  for (int d = 1; d < 32; d *= 2) add_from_below(v, d);
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
    s.first[axis] = p.unwelded || tile[axis] == p.roi_lo[axis] / 32;
    s.empty = s.empty || s.hi[axis] <= s.lo[axis];
  }
  s.cell_mask = s.empty ? 0 : static_cast<std::uint32_t>(bit_span(s.lo[0], s.hi[0] - 1));
  s.sample_mask = s.empty ? 0 : static_cast<std::uint32_t>(bit_span(s.lo[0], s.hi[0]) >> 1);
  s.at_0 = s.first[0] && s.lo[0] == 0 && !s.empty ? 1u : 0u;
  s.inner = s.lo[1] == 0 && s.hi[1] == 32 && s.lo[2] == 0 && s.hi[2] == 32 && s.at_0 == 0;
  return s;
}

}  // namespace isobrick::gpu
