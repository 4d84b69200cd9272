#pragma once

#include "gpu/tile/tile_row_groups.cuh"

// Active edges and active cells of each row, numbered by prefix
// sums within planes and over planes. Where the vertices and cells of a row begin is marked, so
// that 32 threads that take 32 of them find their rows with a vote.

namespace isobrick::inline v0::gpu {

/// The active edges that start in a row, as words of EdgeRow, and those at sample
/// 0, where only the first tiles look. Not all belong to the tile.
struct RowEdges {
  std::uint32_t x, y, z, y_at_0, z_at_0;
  std::uint32_t cells;
  bool own_y, own_z;

  __device__ std::uint32_t xs() const { return own_y && own_z ? __popc(x) : 0; }
  __device__ std::uint32_t ys() const { return own_z ? __popc(y) : 0; }
  __device__ std::uint32_t zs() const { return own_y ? __popc(z) : 0; }
  __device__ std::uint32_t ys_at_0() const { return own_z ? y_at_0 : 0; }
  __device__ std::uint32_t zs_at_0() const { return own_y ? z_at_0 : 0; }
};

__device__ inline std::uint32_t active_cells_of(const RowBits& a, const RowBits& b,
                                                const RowBits& c, const RowBits& d) {
  const std::uint32_t an = a.next(), bn = b.next(), cn = c.next(), dn = d.next();
  const std::uint32_t any = a.at | an | b.at | bn | c.at | cn | d.at | dn;
  const std::uint32_t all = a.at & an & b.at & bn & c.at & cn & d.at & dn;
  return any & ~all;
}

/// Clips a row to the region of interest by its y coordinate. Inner tiles need no clipping.
struct RowLimits {
  std::uint32_t edges_x, edges_yz, cells;  ///< bits
  bool up, own;                            ///< there is a row above; it is no lower tile's

  __device__ static RowLimits of(const Shape& shape, int y) {
    const bool in = y >= shape.lo[1] && y <= shape.hi[1], up = y < shape.hi[1];
    return {in ? shape.cell_mask : 0, in ? shape.sample_mask : 0, in && up ? shape.cell_mask : 0,
            up, y > 0 || shape.first[1]};
  }
};

template <bool Inner, class Rows>
__device__ inline RowEdges edges_of_row(const TileShared& s, const Shape& shape,
                                        const RowLimits& limits, Rows, int row, int z) {
  const bool in = Inner || (z >= shape.lo[2] && z <= shape.hi[2]);
  const bool up = z < (Inner ? 32 : shape.hi[2]);
  const RowBits* at = s.rows + row;
  const int above_here = (Inner ? Rows::kPlane : limits.up) ? 1 : 0;
  const RowBits here = at[0], above = at[above_here];
  at += up ? 33 : 0;
  const RowBits behind = at[0], opposite = at[above_here];
  RowEdges e{0, 0, 0, 0, 0, 0, limits.own, z > 0 || shape.first[2]};
  e.x = (here.at ^ here.next()) & (in ? limits.edges_x : 0);
  e.y = (here.next() ^ above.next()) & (in ? limits.edges_yz : 0);
  e.z = (here.next() ^ behind.next()) & (in ? limits.edges_yz : 0);
  e.cells = active_cells_of(here, above, behind, opposite) & (in && up ? limits.cells : 0);
  if (!Inner && shape.at_0) {
    const std::uint32_t first = in && limits.edges_yz ? 1 : 0;
    e.y_at_0 = (here.at ^ above.at) & first;
    e.z_at_0 = (here.at ^ behind.at) & first;
  }
  return e;
}

/// What is remembered of a row between counting and marking: where its numbers will be.
struct RowCount {
  std::uint32_t before;  ///< of the 32 rows of its group: vertices | cells << 16
  std::uint32_t packed;

  /// Of this row, with `own` for those of later ones.
  __device__ static RowCount of(const RowEdges& e, std::uint32_t& own) {
    const std::uint32_t y_at_0 = e.ys_at_0(), z_at_0 = e.zs_at_0();
    const std::uint32_t y_start = e.xs(), z_start = y_start + y_at_0 + e.ys();
    const std::uint32_t all = z_start + z_at_0 + e.zs();
    const auto cells = static_cast<std::uint32_t>(__popc(e.cells));
    own = all | cells << 16;
    return {0, y_start | z_start << 6 | all << 13 | cells << 20 | y_at_0 << 26 | z_at_0 << 27};
  }
  __device__ std::uint32_t y_start() const { return packed & 63u; }
  __device__ std::uint32_t z_start() const { return packed >> 6 & 127u; }
  __device__ std::uint32_t vertices() const { return packed >> 13 & 127u; }
  __device__ std::uint32_t cells() const { return packed >> 20 & 63u; }
  __device__ std::uint32_t y_at_0() const { return packed >> 26 & 1u; }
  __device__ std::uint32_t z_at_0() const { return packed >> 27 & 1u; }
};

/// `leave_out(y, z, edges)` may take something of a row away.
template <int N, bool Inner, class LeaveOut>
__device__ inline void count_rows_of(TileShared& s, LeaveOut&& leave_out) {
  const Shape shape = s.shape;
  const RowLimits of_lane = RowLimits::of(shape, static_cast<int>(lane_id()));
  for_each_row_group<N>([&](auto rows) {
    const OwnRow at(rows);
    const int row = at.row();
    RowCount count{0, 0};
    std::uint32_t own = 0;
    if (at.exists()) {
      const int y = at.y, z = at.z;
      RowEdges edges = edges_of_row<Inner>(
          s, shape, rows.kPlane ? of_lane : RowLimits::of(shape, y), rows, row, z);
      leave_out(y, z, edges);
      if (!Inner && y == 0) s.plane_at_0[0][z] = static_cast<std::uint8_t>(edges.z_at_0);
      if (!Inner && z == 0) s.plane_at_0[1][y] = static_cast<std::uint8_t>(edges.y_at_0);
      s.edge_bits[0][row] = edges.x;
      s.edge_bits[1][row] = edges.y;
      s.edge_bits[2][row] = edges.z;
      s.active_cells[row] = edges.cells;
      count = RowCount::of(edges, own);
    }
    if constexpr (rows.kPlane) {
      const std::uint32_t sum = warp_inclusive_sum(own);
      count.before = sum - own;
      if (lane_id() == 31) s.plane_sums[at.z] = sum;
    }
    if (!at.exists()) return;
    if constexpr (!rows.kPlane) s.last_row_sums[at.z] = own;
    s.number[0][row] = count.before;
    s.number[1][row] = count.packed;
  });
}

/// The same for any tile.
template <int N, class LeaveOut>
__device__ inline void count_rows(TileShared& s, LeaveOut&& leave_out) {
  if (s.shape.inner)
    count_rows_of<N, true>(s, leave_out);
  else
    count_rows_of<N, false>(s, leave_out);
}

/// Vertices and cells before each plane, found by every warp for itself once all rows are
/// counted: each lane has those before one of the first 32 planes.
struct PlaneBases {
  std::uint32_t before;           ///< vertices | cells << 17, which holds what 31 planes have
  std::uint32_t vertices, cells;  ///< of those planes
  std::uint32_t own;              ///< of the plane without its last row: vertices | cells << 16

  __device__ static PlaneBases of(const TileShared& s) {
    PlaneBases b;
    b.own = s.plane_sums[lane_id()];
    const std::uint32_t last = s.last_row_sums[lane_id()];
    const std::uint32_t v = (b.own & 0xffffu) + (last & 0xffffu), c = (b.own >> 16) + (last >> 16);
    b.vertices = warp_sum(v);
    b.cells = warp_sum(c);
    const std::uint32_t packed = v | c << 17;
    b.before = warp_inclusive_sum(packed) - packed;
    return b;
  }
  __device__ std::uint32_t all_vertices(const TileShared& s) const {
    return vertices + (s.plane_sums[32] & 0xffffu) + (s.last_row_sums[32] & 0xffffu);
  }
};

/// What lies before a thing: vertices and cells.
struct Before {
  std::uint32_t vertices, cells;
};

/// What lies before the rows of a group; in a plane before its first row.
__device__ inline Before before_row_group(const TileShared&, const PlaneBases& b, PlaneRows rows) {
  if (rows.plane == 32) return {b.vertices, b.cells};
  const std::uint32_t before = __shfl_sync(kFullMask, b.before, rows.plane);
  return {before & 0x1ffffu, before >> 17};
}
__device__ inline Before before_row_group(const TileShared& s, const PlaneBases& b, LastRows rows) {
  if (rows.first > 0) return {b.vertices + (s.plane_sums[32] & 0xffffu), b.cells};
  return {(b.before & 0x1ffffu) + (b.own & 0xffffu), (b.before >> 17) + (b.own >> 16)};
}

/// Marks a row with things from `place` to `end` for each 32 listed ones that begin within it,
/// `first` being the first of those. A row has `count` things, at most `Most`.
template <int Most, class Int>
__device__ inline void mark_groups(FirstOfGroup* groups, Int first, Int end, Int place, Int count,
                                   int row) {
  const auto mark_group = [&](Int first) {
    groups[first / 32] = {static_cast<std::uint16_t>(row),
                          static_cast<std::uint16_t>(first - place)};
  };
  if (first < end) mark_group(first);
  if constexpr (Most > 32) {
    if (count <= 32) return;  // hardly any row reaches further
#pragma unroll 1
    for (first += 32; first < end; first += 32) mark_group(first);
  }
}

/// Marks a row with `count` things from `place` on, counted from the first that
/// is listed now; it may lie before that.
template <int Most, std::uint32_t Listed, class Mark>
__device__ inline void mark_row(Mark (&marks)[Listed], FirstOfGroup* groups, int place, int count,
                                int row) {
  if (count > 0 && place >= 0 && place < static_cast<int>(Listed))
    marks[place] = static_cast<Mark>(row + 1);
  const int end = ::min(place + count, static_cast<int>(Listed));
  mark_groups<Most>(groups, ::max((place + 31) & ~31, 0), end, place, count, row);
}
/// The same where all things from 0 on are listed now.
template <int Most, std::uint32_t Listed, class Mark>
__device__ inline void mark_row_from_0(Mark (&marks)[Listed], FirstOfGroup* groups,
                                       std::uint32_t place, std::uint32_t count, int row) {
  if (count == 0 || place >= Listed) return;
  marks[place] = static_cast<Mark>(row + 1);
  const std::uint32_t end = ::min(place + count, Listed);
  mark_groups<Most>(groups, (place + 31) & ~31u, end, place, count, row);
}
inline constexpr int kMaxVerticesOfRow = 32 + 33 + 33, kMaxCellsOfRow = 32;

/// Leaves the row table for later tiles and the numbers within the tile in
/// shared memory, and marks the first vertices and cells.
template <int N>
__device__ inline void number_rows(TileShared& s, const PlaneBases& bases, RowTable& table) {
  auto& lists = lists_of<N>(s);
  for_each_row_group<N>([&](auto rows) {
    const Before before = before_row_group(s, bases, rows);
    const OwnRow at(rows);
    if (!at.exists()) return;
    const int row = at.row();
    const RowCount count{s.number[0][row], s.number[1][row]};
    const std::uint32_t base = before.vertices + (count.before & 0xffffu);
    const std::uint32_t cell = before.cells + (count.before >> 16);
    const std::uint32_t y = count.y_start(), z = count.z_start();
    table.rows[row] = base | y << 17 | z << 23;
    s.number[0][row] = base;
    s.number[1][row] = base + y + count.y_at_0();
    s.number[2][row] = base + z + count.z_at_0();
    s.cell_base[row] = static_cast<std::uint16_t>(cell);
    mark_row_from_0<kMaxVerticesOfRow>(lists.vertex_marks, lists.vertex_groups, base,
                                       count.vertices(), row);
    mark_row_from_0<kMaxCellsOfRow>(lists.cells, lists.cell_groups, cell, count.cells(), row);
  });
  if (threadIdx.x == 0) {
    table.rows[kRowsOfTile] = bases.all_vertices(s);
    s.cell_base[kRowsOfTile] = static_cast<std::uint16_t>(s.all_cells);
  }
}

/// Marks the rows of a list anew, from thing `first` of the tile on, for tiles that have more
/// than are listed at a time. `first_of(row)` is a row's first thing, also of the row behind the
/// last; `next` is the list's word in TileShared. Between barriers.
template <int N, int Most, std::uint32_t Listed, class Mark, class FirstOf>
__device__ inline void mark_list(Mark (&marks)[Listed], FirstOfGroup* groups, std::uint32_t& next,
                                 std::uint32_t first, const FirstOf& first_of) {
  for (unsigned i = own_thread(); i < Listed; i += N) marks[i] = 0;
  if (threadIdx.x == 0) next = 0;
  __syncthreads();
  for (auto row = static_cast<int>(own_thread()); row < kRowsOfTile; row += N) {
    const std::uint32_t begin = first_of(row), end = first_of(row + 1);
    mark_row<Most>(marks, groups, static_cast<int>(begin - first), static_cast<int>(end - begin),
                   row);
  }
  __syncthreads();
}

template <int N>
__device__ inline void mark_vertices(TileShared& s, std::uint32_t first) {
  auto& lists = lists_of<N>(s);
  mark_list<N, kMaxVerticesOfRow>(
      lists.vertex_marks, lists.vertex_groups, s.next_vertices, first,
      [&](int row) { return row < kRowsOfTile ? s.number[0][row] : s.all_vertices; });
}
template <int N>
__device__ inline void mark_cells(TileShared& s, std::uint32_t first) {
  auto& lists = lists_of<N>(s);
  mark_list<N, kMaxCellsOfRow>(lists.cells, lists.cell_groups, s.next_cells, first, [&](int row) {
    return static_cast<std::uint32_t>(s.cell_base[row]);
  });
}

}  // namespace isobrick::gpu
