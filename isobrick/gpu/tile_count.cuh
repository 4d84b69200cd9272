#pragma once

#include "isobrick/gpu/tile_shared.cuh"

// Second step: crossing edges and active cells of each row, numbered by prefix
// sums. Where the vertices and cells of a row begin is marked, so that 32
// threads that take 32 of them find their rows with a vote.

namespace isobrick::gpu {

/// The crossing edges that start in a row and belong to the tile, as words of
/// the CPU's EdgeRow; those at sample 0 are apart.
struct RowEdges {
  std::uint32_t x, y, z, y_at_0, z_at_0;
  std::uint32_t cells;

  __device__ std::uint32_t y_start() const { return __popc(x); }
  __device__ std::uint32_t z_start() const { return __popc(x) + y_at_0 + __popc(y); }
  __device__ std::uint32_t vertices() const { return z_start() + z_at_0 + __popc(z); }
};

__device__ inline std::uint32_t mixed_cells(const RowBits& a, const RowBits& b, const RowBits& c,
                                            const RowBits& d) {
  const std::uint32_t any = a.at | a.next | b.at | b.next | c.at | c.next | d.at | d.next;
  const std::uint32_t all = a.at & a.next & b.at & b.next & c.at & c.next & d.at & d.next;
  return any & ~all;
}

__device__ inline RowEdges edges_of_row(const TileShared& s, const Shape& shape, int row, int y,
                                        int z) {
  RowEdges e{0, 0, 0, 0, 0, 0};
  if (z < shape.lo[2] || z > shape.hi[2] || y < shape.lo[1] || y > shape.hi[1]) return e;
  const bool up_y = y < shape.hi[1], up_z = z < shape.hi[2];
  const bool own_y = y > 0 || shape.first[1], own_z = z > 0 || shape.first[2];
  const RowBits here = s.rows[row];
  const RowBits above = up_y ? s.rows[row + 1] : here;
  const RowBits behind = up_z ? s.rows[row + 33] : here;
  if (own_y && own_z) e.x = (here.at ^ here.next) & shape.cell_mask;
  if (own_z) {
    e.y = (here.next ^ above.next) & shape.sample_mask;
    e.y_at_0 = (here.at ^ above.at) & shape.at_0;
  }
  if (own_y) {
    e.z = (here.next ^ behind.next) & shape.sample_mask;
    e.z_at_0 = (here.at ^ behind.at) & shape.at_0;
  }
  if (up_y && up_z) e.cells = mixed_cells(here, above, behind, s.rows[row + 34]) & shape.cell_mask;
  return e;
}

/// What a thread remembers of a row between counting and marking.
struct RowCount {
  std::uint32_t before;  ///< of the 32 rows of its warp: vertices | cells << 16
  std::uint32_t packed;

  __device__ static RowCount of(const RowEdges& e) {
    return {0, e.y_start() | e.z_start() << 6 | e.vertices() << 13 |
                   static_cast<std::uint32_t>(__popc(e.cells)) << 20 | e.y_at_0 << 26 |
                   e.z_at_0 << 27};
  }
  __device__ std::uint32_t y_start() const { return packed & 63u; }
  __device__ std::uint32_t z_start() const { return packed >> 6 & 127u; }
  __device__ std::uint32_t vertices() const { return packed >> 13 & 127u; }
  __device__ std::uint32_t cells() const { return packed >> 20 & 63u; }
  __device__ std::uint32_t y_at_0() const { return packed >> 26 & 1u; }
  __device__ std::uint32_t z_at_0() const { return packed >> 27 & 1u; }
};

template <int N>
struct RowCounts {
  RowCount of_step[Team<N>::kSteps];
};

template <int N>
__device__ inline void count_rows(TileShared& s, const Shape& shape, RowCounts<N>& counts) {
#pragma unroll
  for (int step = 0; step < Team<N>::kSteps; ++step) {
    const int row = step * N + static_cast<int>(threadIdx.x);
    RowCount& count = counts.of_step[step];
    count = {0, 0};
    std::uint32_t sum = 0;
    if ((row & ~31) < kRowsOfTile) {
      if (row < kRowsOfTile) {
        const int z = static_cast<int>(z_of_row(row));
        count = RowCount::of(edges_of_row(s, shape, row, row - 33 * z, z));
      }
      const std::uint32_t own = count.vertices() | count.cells() << 16;
      sum = warp_inclusive_sum(own);
      count.before = sum - own;
    }
    if (lane_id() == 31) s.step_sums[step * Team<N>::kWarps + warp_id()] = sum;
  }
}

/// By one warp, between two barriers: the sums before each 32 rows, and of all.
template <int N>
__device__ inline void sum_steps(TileShared& s) {
  constexpr unsigned kSums = Team<N>::kSteps * Team<N>::kWarps;
  static_assert(kSums <= 64);
  const unsigned i = 2 * lane_id();
  const std::uint32_t a = i < kSums ? s.step_sums[i] : 0;
  const std::uint32_t b = i + 1 < kSums ? s.step_sums[i + 1] : 0;
  const std::uint32_t va = a & 0xffffu, vb = b & 0xffffu, ca = a >> 16, cb = b >> 16;
  const std::uint32_t v = warp_inclusive_sum(va + vb), c = warp_inclusive_sum(ca + cb);
  s.step_vertices[i] = v - va - vb;
  s.step_vertices[i + 1] = v - vb;
  s.step_cells[i] = c - ca - cb;
  s.step_cells[i + 1] = c - cb;
  if (lane_id() == 31) {
    s.all_vertices = v;
    s.all_cells = c;
  }
}

/// Marks a row with `count` things from `place` on, counted from the first that
/// is listed now; it may lie before that.
template <class Mark>
__device__ inline void mark_row(Mark* marks, std::uint16_t* rows, int place, int count, int row) {
  constexpr int kGroups = kListed / 32;
  if (count == 0) return;
  if (place >= 0 && place < static_cast<int>(kListed)) marks[place] = static_cast<Mark>(row + 1);
  for (int group = ::max((place + 31) >> 5, 0); group < kGroups && 32 * group < place + count;
       ++group)
    rows[group] = static_cast<std::uint16_t>(row);
}

/// Leaves the row table for later tiles and the numbers within the tile in
/// shared memory, and marks the first vertices and cells.
template <int N>
__device__ inline void publish_rows(TileShared& s, const RowCounts<N>& counts, RowTable& table) {
#pragma unroll
  for (int step = 0; step < Team<N>::kSteps; ++step) {
    const int row = step * N + static_cast<int>(threadIdx.x);
    if (row >= kRowsOfTile) break;
    const RowCount& count = counts.of_step[step];
    const unsigned sum = step * Team<N>::kWarps + warp_id();
    const std::uint32_t base = s.step_vertices[sum] + (count.before & 0xffffu);
    const std::uint32_t cell = s.step_cells[sum] + (count.before >> 16);
    const std::uint32_t y = count.y_start(), z = count.z_start();
    table.rows[row] = base | y << 17 | z << 23;
    s.x_base[row] = base;
    s.y_base[row] = base + y + count.y_at_0();
    s.z_base[row] = base + z + count.z_at_0();
    s.cell_base[row] = static_cast<std::uint16_t>(cell);
    mark_row(s.vertex_marks, s.vertex_rows, static_cast<int>(base),
             static_cast<int>(count.vertices()), row);
    mark_row(s.cells, s.cell_rows, static_cast<int>(cell), static_cast<int>(count.cells()), row);
  }
  if (threadIdx.x == 0) {
    table.rows[kRowsOfTile] = s.all_vertices;
    s.cell_base[kRowsOfTile] = static_cast<std::uint16_t>(s.all_cells);
  }
}

/// Marks the vertices from `first` on, for tiles that have more than are listed
/// at a time. Between barriers; the numbers are still those within the tile.
template <int N>
__device__ inline void mark_vertices(TileShared& s, std::uint32_t first) {
  for (unsigned i = threadIdx.x; i < kListed; i += N) s.vertex_marks[i] = 0;
  __syncthreads();
  for (int row = static_cast<int>(threadIdx.x); row < kRowsOfTile; row += N) {
    const std::uint32_t begin = s.x_base[row];
    const std::uint32_t end = row + 1 < kRowsOfTile ? s.x_base[row + 1] : s.all_vertices;
    mark_row(s.vertex_marks, s.vertex_rows, static_cast<int>(begin - first),
             static_cast<int>(end - begin), row);
  }
  __syncthreads();
}

template <int N>
__device__ inline void mark_cells(TileShared& s, std::uint32_t first) {
  for (unsigned i = threadIdx.x; i < kListed; i += N) s.cells[i] = 0;
  __syncthreads();
  for (int row = static_cast<int>(threadIdx.x); row < kRowsOfTile; row += N) {
    const std::uint32_t begin = s.cell_base[row], end = s.cell_base[row + 1];
    mark_row(s.cells, s.cell_rows, static_cast<int>(begin - first), static_cast<int>(end - begin),
             row);
  }
  __syncthreads();
}

/// The row of each lane's thing, from the marks of 32 in a row.
__device__ inline std::uint32_t row_of_lane(std::uint32_t mark, std::uint32_t row_before) {
  const unsigned begins = __ballot_sync(kAll, mark != 0) & (lanes_below() << 1 | 1u);
  const std::uint32_t found = __shfl_sync(kAll, mark, 31 - __clz(static_cast<int>(begins)));
  return begins ? found - 1 : row_before;
}

/// The place of the set bit with `rank` set bits below it.
__device__ inline std::uint32_t nth_bit(std::uint32_t word, std::uint32_t rank) {
  std::uint32_t place = 0;
#pragma unroll
  for (std::uint32_t half = 16; half; half /= 2) {
    const std::uint32_t upper = place + half;
    if (static_cast<std::uint32_t>(__popc(word & ~(~0u << upper))) <= rank) place = upper;
  }
  return place;
}

/// The part of a list that a warp works on: whole groups of 32.
struct WarpPart {
  std::uint32_t begin, end;
};

template <int N>
__device__ inline WarpPart part_of_warp(std::uint32_t listed) {
  const std::uint32_t groups = (listed + 31) / 32;
  const std::uint32_t begin = groups * warp_id() / Team<N>::kWarps * 32;
  const std::uint32_t end = groups * (warp_id() + 1) / Team<N>::kWarps * 32;
  return {begin, ::min(end, listed)};
}

__device__ inline std::uint32_t triangles_of(const TileShared& s, std::uint32_t index) {
  return s.triangles[5 * index] >> 12;
}

/// Finds the marked cells and their cases; the number of triangles of this
/// warp's part. `first` is the number of the first cell that is listed.
template <int N>
__device__ inline std::uint32_t find_cells(TileShared& s, const Shape& shape, std::uint32_t first,
                                           std::uint32_t listed) {
  const WarpPart part = part_of_warp<N>(listed);
  std::uint32_t triangles = 0;
  for (std::uint32_t begin = part.begin; begin < part.end; begin += 32) {
    const std::uint32_t i = begin + lane_id();
    const std::uint32_t row = row_of_lane(s.cells[i], s.cell_rows[begin / 32]);
    const RowBits a = s.rows[row], b = s.rows[row + 1], c = s.rows[row + 33], d = s.rows[row + 34];
    const std::uint32_t x =
        nth_bit(mixed_cells(a, b, c, d) & shape.cell_mask, first + i - s.cell_base[row]);
    const auto pair = [x](const RowBits& r) { return (r.at >> x & 1u) | (r.next >> x & 1u) << 1; };
    const std::uint32_t index = pair(a) | pair(b) << 2 | pair(c) << 4 | pair(d) << 6;
    if (i < part.end) {
      triangles += triangles_of(s, index);
      s.cells[i] = x | row << 5 | index << 16;
    }
  }
  return warp_sum(triangles);
}

/// Of one value a warp: the sum before this warp and of all.
struct SumOfWarps {
  std::uint32_t before, all;
};

template <int N>
__device__ inline SumOfWarps sum_of_warps(const std::uint32_t* values) {
  SumOfWarps sum;
  const std::uint32_t v = lane_id() < Team<N>::kWarps ? values[lane_id()] : 0;
  sum.all = warp_sum(v);
  sum.before = warp_sum(lane_id() < warp_id() ? v : 0u);
  return sum;
}

}  // namespace isobrick::gpu
