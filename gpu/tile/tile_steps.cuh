#pragma once

#include "gpu/tile/on_samples_mesh.cuh"
#include "gpu/tile/tile_barrier.cuh"
#include "gpu/tile/tile_boundary.cuh"
#include "gpu/tile/tile_count.cuh"
#include "gpu/tile/tile_nan.cuh"
#include "gpu/tile/tile_triangles.cuh"
#include "gpu/tile/tile_vertices.cuh"
#include "gpu/tile/trilinear_mesh.cuh"

// The steps from the samples of a tile to its mesh, and where its warps wait for each other.

namespace isobrick::inline v0::gpu {

/// A tile without a vertex or a cell publishes zero sums and no row table: later tiles add nothing
/// and find no vertex there.
__device__ inline void pass_empty_tile(TileShared& s, const TileParams& p) {
  if (threadIdx.x != 0) return;
  publish_sum(p.order[s.item].vertices, s.item, 0);
  publish_sum(p.order[s.item].triangles, s.item, 0);
  s.number_base = 0;
  publish_boundary(s, p);
}

/// Whether all cells and vertices of a tile are listed at once, and its warps wait for no more
/// than they need (WarpBarriers). Others take turns, with __syncthreads between them.
template <int N, bool Nan>
__device__ inline bool listed_at_once(const TileShared& s) {
  return kHasWarpBarriers && !Nan && ::max(s.all_cells, s.all_vertices) <= ListsOf<N>::kListed;
}

/// One thread, before a block's first tile.
template <int N>
__device__ inline void init_barriers(WarpBarriers& barriers) {
  if constexpr (!kHasWarpBarriers) return;
  init_barrier(barriers.cells, BlockConfig<N>::kWarps);
  init_barrier(barriers.vertex_base, 1);
  init_barrier(barriers.neighbours, 1);
  barriers.turn = 1;
}

/// The inside bits of a tile's samples, and in volumes that may hold NaN the samples that are none.
/// Other tiles need the room of those for their lists, which are emptied beside it.
template <int N, class T, bool Nan, TileExtra Extra>
__device__ inline void classify_tile(TileShared& s, const TileParams& p,
                                     const Classifier<T>& classifier) {
  if constexpr (Nan && has_samples(Extra)) {
    if (p.on_samples.may_have_nan)
      find_nan<N, T>(s, p);
    else
      find_outside<N>(s, p);
  } else if constexpr (Nan) {
    find_nan<N, T>(s, p);
  } else {
    clear_lists<N>(s, s.all_cells, s.all_vertices);
  }
  classify_samples<N>(s, p, classifier);
  __syncthreads();
}

/// Counts a tile's active edges and active cells, and numbers its vertices. False where there
/// are none; the last tile, which reports the totals, goes on.
template <int N, bool Nan, TileExtra Extra>
__device__ inline bool count_tile(TileShared& s, const TileParams& p) {
  count_rows<N>(s, [&](int y, int z, RowEdges& edges) {
    if constexpr (Nan) leave_out_nan(nan_rows_of(s), y, z, edges);
    if constexpr (has_samples(Extra))
      if (sample_work(p).any_at) leave_out_coincident(sample_work(p), y, z, edges);
    if constexpr (is_trilinear(Extra)) edges.cells &= ~trilinear_work(p).cells[33 * z + y];
  });
  __syncthreads();
  if constexpr (Nan) clear_lists<N>(s, ListsOf<N>::kListed, ListsOf<N>::kListed);
  const PlaneBases bases = PlaneBases::of(s);
  const std::uint32_t vertices = bases.all_vertices(s);
  std::uint32_t beside = 0;  // triangles of cells that are in no list
  if constexpr (is_trilinear(Extra)) beside = trilinear_work(p).own_triangles;
  if (!Nan && vertices + bases.cells + beside == 0 && s.item + 1 < s.items) {
    pass_empty_tile(s, p);
    __syncthreads();
    return false;
  }
  if (threadIdx.x == 0) {
    s.next_cells = s.next_vertices = 0;
    s.all_vertices = vertices;
    s.all_cells = bases.cells;
    s.extra_vertices = 0;
    if constexpr (has_samples(Extra)) s.extra_vertices += sample_work(p).own;
    if constexpr (is_trilinear(Extra)) s.extra_vertices += trilinear_work(p).own_vertices;
    if (listed_at_once<N, Nan>(s)) s.barriers.turn ^= 1;
    publish_sum(p.order[s.item].vertices, s.item, s.all_vertices + s.extra_vertices);
  }
  if constexpr (Nan) __syncthreads();  // the lists are empty
  number_rows<N>(s, bases, p.row_tables[s.tile.slot]);
  __syncthreads();
  return true;
}

/// The triangles of a tile with more cells than are listed at a time. The last
/// cells stay listed.
template <int N>
__device__ inline std::uint32_t list_cells_in_rounds(TileShared& s) {
  constexpr std::uint32_t kListed = ListsOf<N>::kListed;
  const std::uint32_t cells = s.all_cells;
  std::uint32_t triangles = 0;
  for (std::uint32_t first = 0; first < cells; first += kListed) {
    if (first > 0) mark_cells<N>(s, first);
    const std::uint32_t listed = ::min(cells - first, kListed);
    list_cells<N>(s, listed);
    __syncthreads();
    triangles += triangles_before<N>(s, (listed + 31) / 32);
    __syncthreads();
  }
  return triangles;
}

/// Lists the tile's cells and finds where its vertices and triangles go. Two warps wait for other
/// tiles; the others wait for no more than the place of the vertices.
template <int N, bool Nan, TileExtra Extra>
__device__ inline void place_tile(TileShared& s, const TileParams& p) {
  const std::uint32_t cells = s.all_cells;
  const bool at_once = listed_at_once<N, Nan>(s);
  const std::uint32_t turn = s.barriers.turn;
  if (warp_id() == BlockConfig<N>::kVertices) {
    place_vertices(s, p);
    if (at_once) arrive(s.barriers.vertex_base);
    if (lane_id() == 0) publish_boundary(s, p);
  }
  std::uint32_t triangles = 0;
  if (at_once) {
    list_cells<N>(s, cells);
    arrive(s.barriers.cells);
  } else {
    triangles = list_cells_in_rounds<N>(s);
    // No turn has been between where there is no cell: with NaN vertices may belong to cells of
    // others only.
    if constexpr (Nan || !kHasWarpBarriers) __syncthreads();
  }
  const bool for_vertices = warp_id() == BlockConfig<N>::kVertices,
             for_triangles = warp_id() == BlockConfig<N>::kTriangles;
  Neighbour neighbour{};
  if (for_vertices) neighbour = Neighbour::of_lane(s, p);
  if (at_once && (for_vertices || for_triangles)) wait(s.barriers.cells, turn);
  if (for_triangles) {
    if (at_once) triangles = triangles_before<N>(s, (cells + 31) / 32);
    if constexpr (has_samples(Extra)) triangles += sample_work(p).kept + sample_work(p).capped;
    if constexpr (is_trilinear(Extra)) triangles += trilinear_work(p).own_triangles;
    if (lane_id() == 0) {
      s.all_triangles = triangles;
      publish_sum(p.order[s.item].triangles, s.item, triangles);
    }
    place_triangles(s, p, triangles);
  }
  if (for_vertices) {
    fetch_boundaries<N>(s, p, neighbour);
    if constexpr (has_samples(Extra)) fetch_owners(s, p);
    if (at_once) arrive(s.barriers.neighbours);
  } else if (at_once) {
    wait(s.barriers.vertex_base, turn);
  }
}

template <int N, class T, bool Normals>
__device__ inline void write_vertices(TileShared& s, const TileParams& p) {
  constexpr std::uint32_t kListed = ListsOf<N>::kListed;
  const std::uint32_t vertices = s.all_vertices;
  if (s.vertex_base + vertices + s.extra_vertices > p.vertex_capacity) return;
  for (std::uint32_t first = 0; first < vertices; first += kListed) {
    if (first > 0) mark_vertices<N>(s, first);
    write_listed_vertices<N, T, Normals>(s, p, first, ::min(vertices - first, kListed));
    if (vertices > kListed) __syncthreads();
  }
}

template <int N>
__device__ inline void write_triangles(TileShared& s, const TileParams& p) {
  constexpr std::uint32_t kListed = ListsOf<N>::kListed;
  const std::uint32_t cells = s.all_cells;
  std::uint64_t base = s.triangle_base;
  if (base + s.all_triangles > p.triangle_capacity) return;
  for (std::uint32_t first = 0; first < cells; first += kListed) {
    const std::uint32_t listed = ::min(cells - first, kListed);
    if (cells > kListed) {
      mark_cells<N>(s, first);
      list_cells<N>(s, listed);
      __syncthreads();
    }
    write_listed_triangles<N>(s, p, listed, base);
    if (cells > kListed) {
      base += triangles_before<N>(s, (listed + 31) / 32);
      __syncthreads();
    }
  }
}

/// Whether so many vertices are left that a warp which comes late may take some as well: others
/// would wait for it.
template <int N>
__device__ inline bool can_help(TileShared& s) {
  const std::uint32_t taken = BlockWord(s.next_vertices).load(cuda::memory_order_relaxed);
  return BlockConfig<N>::kWarps == 1 ||
         uniform(taken) + BlockConfig<N>::kWarps <= (s.all_vertices + 31) / 32;
}

/// What the tables of cases don't have: the triangles behind the others, in the order of the CPU.
template <int N, class T, bool Normals, TileExtra Extra>
__device__ inline void write_extra(const TileShared& s, const TileParams& p, T threshold) {
  std::uint32_t capped = 0, patched = 0;
  if constexpr (has_samples(Extra)) capped = sample_work(p).capped;
  if constexpr (is_trilinear(Extra)) {
    patched = trilinear_work(p).own_triangles;
    write_inner_vertices<N, T, Normals>(s, p);
    write_patched_triangles<N, has_samples(Extra)>(s, p, capped);
  }
  if constexpr (has_samples(Extra)) {
    write_sample_vertices<N, T, Normals, is_trilinear(Extra)>(s, p, threshold);
    write_kept_triangles<N>(s, p, patched + capped);
    write_cap_triangles<N, T, is_trilinear(Extra)>(s, p);
  }
  // The first warp takes the next tile, and others still asked for this one.
  if constexpr (Extra != TileExtra::none) __syncthreads();
}

/// Writes the mesh of a tile that has its place.
template <int N, class T, bool Normals, bool Nan, TileExtra Extra>
__device__ inline void write_tile(TileShared& s, const TileParams& p, T threshold) {
  const bool at_once = listed_at_once<N, Nan>(s);
  const bool has_waited = at_once && warp_id() == BlockConfig<N>::kVertices;
  // With normals vertices are most of the work, and all warps write them.
  if (!has_waited || Normals || can_help<N>(s)) write_vertices<N, T, Normals>(s, p);
  // Numbers of vertices that tiles before this one own.
  if (!at_once) {
    __syncthreads();
    adopt_at_0<N>(s);
  } else {
    if (!has_waited) wait(s.barriers.neighbours, s.barriers.turn);
    adopt_at_0<N, !Normals>(s);
  }
  // Elsewhere the first warp may still write vertices.
  __syncthreads();
  adopt_rows<N>(s);
  number_edges<N>(s);
  __syncthreads();
  write_triangles<N>(s, p);
  write_extra<N, T, Normals, Extra>(s, p, threshold);
}

}  // namespace isobrick::gpu
