#pragma once

#include "isobrick/gpu/tile_shared.cuh"

// Second step: crossing edges and active cells of each row, numbered by prefix
// sums; lists of both.

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
    e.y_at_0 = (here.at ^ above.at) & (shape.first[0] && shape.lo[0] == 0 ? 1u : 0u);
  }
  if (own_y) {
    e.z = (here.next ^ behind.next) & shape.sample_mask;
    e.z_at_0 = (here.at ^ behind.at) & (shape.first[0] && shape.lo[0] == 0 ? 1u : 0u);
  }
  if (up_y && up_z) {
    const RowBits both = s.rows[row + 34];
    const std::uint32_t any =
        here.at | here.next | above.at | above.next | behind.at | behind.next | both.at | both.next;
    const std::uint32_t all =
        here.at & here.next & above.at & above.next & behind.at & behind.next & both.at & both.next;
    e.cells = any & ~all & shape.cell_mask;
  }
  return e;
}

/// A warp's rows lie next to each other and are taken 32 at a time.
struct RowStep {
  int row, y, z;
  bool valid;
};

__device__ inline RowStep row_step(int step) {
  RowStep r;
  const int warp = static_cast<int>(threadIdx.x >> 5);
  const int in_warp = step * 32 + static_cast<int>(lane_id());
  r.row = warp * kRowsOfWarp + in_warp;
  r.valid = in_warp < kRowsOfWarp && r.row < kRowsOfTile;
  if (!r.valid) r.row = 0;
  r.z = static_cast<int>(z_of_row(r.row));
  r.y = r.row - 33 * r.z;
  return r;
}

__device__ inline RowEdges edges_of_step(const TileShared& s, const Shape& shape,
                                         const RowStep& r) {
  if (!r.valid) return {0, 0, 0, 0, 0, 0};
  return edges_of_row(s, shape, r.row, r.y, r.z);
}

/// Vertices and cells before each of a thread's rows, counted from the warp's first.
struct RowPrefix {
  std::uint32_t packed[kRowSteps];  ///< vertices | cells << 16
  __device__ std::uint32_t vertices(int step) const { return packed[step] & 0xffffu; }
  __device__ std::uint32_t cells(int step) const { return packed[step] >> 16; }
};

__device__ inline std::uint32_t warp_inclusive_sum(std::uint32_t v) {
#pragma unroll
  for (int d = 1; d < 32; d *= 2) {
    const std::uint32_t below = __shfl_up_sync(kAll, v, d);
    if (lane_id() >= d) v += below;
  }
  return v;
}

/// Counts, and leaves each warp's sums in shared memory. A warp has at most 137
/// rows of 98 vertices, so 16 bits hold a sum.
__device__ inline void count_rows(TileShared& s, const Shape& shape, RowPrefix& prefix) {
  std::uint32_t before = 0;
#pragma unroll
  for (int step = 0; step < kRowSteps; ++step) {
    const RowEdges e = edges_of_step(s, shape, row_step(step));
    const std::uint32_t own = e.vertices() | static_cast<std::uint32_t>(__popc(e.cells)) << 16;
    const std::uint32_t sum = warp_inclusive_sum(own);
    prefix.packed[step] = before + sum - own;
    before += __shfl_sync(kAll, sum, 31);
  }
  if (lane_id() == 0) {
    s.warp_vertices[threadIdx.x >> 5] = before & 0xffffu;
    s.warp_cells[threadIdx.x >> 5] = before >> 16;
  }
}

struct SumOfWarps {
  std::uint32_t before, all;
};

/// Of one value a warp: the sum before this warp and of all.
__device__ inline SumOfWarps sum_of_warps(const std::uint32_t (&values)[kWarps]) {
  SumOfWarps sum{0, 0};
#pragma unroll
  for (int w = 0; w < kWarps; ++w) {
    const std::uint32_t v = values[w];
    if (w < static_cast<int>(threadIdx.x >> 5)) sum.before += v;
    sum.all += v;
  }
  return sum;
}

/// Appends code + bit for each set bit of each lane's word at its `place`.
/// Words with many bits are written by the whole warp, one after the other.
__device__ inline void list_bits(std::uint32_t* list, std::uint32_t word, std::uint32_t code,
                                 std::uint32_t place) {
  constexpr int kMany = 6;
  for (unsigned many = __ballot_sync(kAll, __popc(word) > kMany); many; many &= many - 1) {
    const int source = __ffs(static_cast<int>(many)) - 1;
    const std::uint32_t w = __shfl_sync(kAll, word, source);
    const std::uint32_t c = __shfl_sync(kAll, code, source);
    const std::uint32_t at = __shfl_sync(kAll, place, source) + __popc(w & lanes_below());
    if ((w >> lane_id() & 1u) && at < kListed) list[at] = c + lane_id();
    if (static_cast<int>(lane_id()) == source) word = 0;
  }
  for (; word; word &= word - 1, ++place)
    if (place < kListed) list[place] = code + static_cast<std::uint32_t>(__ffs(static_cast<int>(word)) - 1);
}

/// Lists the cells numbered from `first` on, as many as there is room for.
/// Places below `first` wrap around to huge numbers and are left out.
__device__ inline void list_cells(TileShared& s, const Shape& shape, const RowPrefix& prefix,
                                  std::uint32_t before_warp, std::uint32_t first) {
#pragma unroll 1
  for (int step = 0; step < kRowSteps; ++step) {
    const RowStep r = row_step(step);
    const std::uint32_t cells = edges_of_step(s, shape, r).cells;
    list_bits(s.cells, cells, static_cast<std::uint32_t>(r.y << 5 | r.z << 10),
              before_warp + prefix.cells(step) - first);
  }
}

/// Lists the tile's own vertices numbered from `first` on.
__device__ inline void list_edges(TileShared& s, const Shape& shape, const RowPrefix& prefix,
                                  std::uint32_t before_warp, std::uint32_t first) {
#pragma unroll 1
  for (int step = 0; step < kRowSteps; ++step) {
    const RowStep r = row_step(step);
    const RowEdges e = edges_of_step(s, shape, r);
    const auto code = static_cast<std::uint32_t>(r.y << 6 | r.z << 12);
    std::uint32_t place = before_warp + prefix.vertices(step) - first;
    list_bits(s.edges, e.x, code, place);
    place += __popc(e.x);
    if (e.y_at_0) {
      if (place < kListed) s.edges[place] = code | 1u << 18;
      ++place;
    }
    list_bits(s.edges, e.y, (code | 1u << 18) + 1, place);
    place += __popc(e.y);
    if (e.z_at_0) {
      if (place < kListed) s.edges[place] = code | 2u << 18;
      ++place;
    }
    list_bits(s.edges, e.z, (code | 2u << 18) + 1, place);
  }
}

/// The eight inside bits of a cell.
__device__ inline std::uint32_t case_of(const TileShared& s, std::uint32_t x, std::uint32_t row) {
  const auto pair = [&](std::uint32_t r) {
    const RowBits b = s.rows[r];
    return (b.at >> x & 1u) | (b.next >> x & 1u) << 1;
  };
  return pair(row) | pair(row + 1) << 2 | pair(row + 33) << 4 | pair(row + 34) << 6;
}

__device__ inline std::uint32_t row_of_cell(std::uint32_t cell) {
  return (cell >> 10 & 31u) * 33u + (cell >> 5 & 31u);
}

/// The part of a list that a warp works on: whole groups of 32.
struct WarpPart {
  std::uint32_t begin, end;
};

__device__ inline WarpPart part_of_warp(std::uint32_t listed) {
  const std::uint32_t groups = (listed + 31) / 32;
  const std::uint32_t each = (groups + kWarps - 1) / kWarps * 32;
  const std::uint32_t begin = ::min((threadIdx.x >> 5) * each, listed);
  return {begin, ::min(begin + each, listed)};
}

__device__ inline std::uint32_t triangles_of(const TileShared& s, std::uint32_t index) {
  return s.triangles[5 * index] >> 12;
}

/// Finds the cases of the listed cells; the number of triangles of this warp's part.
__device__ inline std::uint32_t find_cases(TileShared& s, std::uint32_t listed) {
  const WarpPart part = part_of_warp(listed);
  std::uint32_t triangles = 0;
  for (std::uint32_t i = part.begin + lane_id(); i < part.end; i += 32) {
    const std::uint32_t cell = s.cells[i] & 0x7fffu;
    const std::uint32_t index = case_of(s, cell & 31u, row_of_cell(cell));
    triangles += triangles_of(s, index);
    s.cells[i] = cell | index << 16;
  }
  return __reduce_add_sync(kAll, triangles);
}

}  // namespace isobrick::gpu
