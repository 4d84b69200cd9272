#pragma once

#include "gpu/tile/tile_cells.cuh"

// Where the surface follows the trilinear interpolant: which cells of a tile have another patch
// than their case. The arithmetic is that of the CPU (surface/cell_topology.h).

namespace isobrick::inline v0::gpu {

/// What is kept of a patch where degenerate triangles are left out.
__device__ inline KeptOfCell kept_of_patch(const TopologyTables& tables, const CellPatch& patch,
                                           std::uint32_t at) {
  KeptOfCell kept;
  const std::uint8_t* corners = tables.corners + patch.first;
  // What is no edge is an inner vertex, which never coincides with another.
  const auto vertex = [&](std::uint32_t corner) {
    return corner < 12 ? vertex_on(corner, at) : 8u + corner;
  };
  for (std::uint32_t t = 0; t < patch.triangles; ++t, corners += 3)
    kept.add(t, vertex(corners[0]), vertex(corners[1]), vertex(corners[2]));
  return kept;
}

/// Between classify_tile() and count_tile(): finds the cells, a row a warp, and counts what they
/// make. `OnSamples`: the mesh has vertices on samples, and which coincide is known.
template <int N, class T, bool Nan, bool OnSamples>
__device__ inline void find_patched(TileShared& s, const TileParams& p) {
  TrilinearWork& w = trilinear_work(p);
  const TopologyTables& tables = *p.trilinear.tables;
  if (threadIdx.x == 0) w.any = w.own_vertices = w.own_triangles = 0;
  for (unsigned row = own_thread(); row < kRowsOfTile; row += N)
    w.cells[row] = w.triangles[row] = w.vertices[row] = 0;
  __syncthreads();
  const auto x = static_cast<int>(lane_id());
  for (auto r = static_cast<int>(warp_id()); r < 32 * 32; r += BlockConfig<N>::kWarps) {
    const int y = r % 32, z = r / 32, row = 33 * z + y;
    if (s.shape.empty || y < s.shape.lo[1] || y >= s.shape.hi[1] || z < s.shape.lo[2] ||
        z >= s.shape.hi[2])
      continue;
    const std::uint32_t index = case_at(s, row, x);
    bool needs_values = (s.shape.cell_mask >> x & 1u) != 0 && tables.cases[index].needs_values;
    if constexpr (Nan) needs_values = needs_values && corners_at(nan_rows_of(s).rows, x, y, z) == 0;
    if (!__any_sync(kFullMask, needs_values)) continue;
    int patch = 0;
    bool is_patched = false;
    if (needs_values) {
      double d[8];
      load_cell<T>(s, p, x, y, z, d);
      patch = cell_topology::patch_of(tables, static_cast<int>(index), d);
      is_patched = patch != tables.cases[index].consistent_patch;
      if (is_patched) w.patches[32 * r + x] = static_cast<std::uint16_t>(patch);
    }
    __syncwarp();
    const std::uint32_t cells = __ballot_sync(kFullMask, is_patched);
    std::uint32_t count = is_patched ? tables.patches[patch].triangles : 0u;
    if constexpr (OnSamples) {
      SampleWork& on_samples = sample_work(p);
      const std::uint32_t at =
          is_patched && on_samples.any_at ? corners_at(on_samples.at, x, y, z) : 0;
      KeptOfCell kept;
      std::uint32_t left_out = 0;
      if (at != 0) {
        kept = kept_of_patch(tables, tables.patches[patch], at);
        left_out = count - static_cast<std::uint32_t>(__popc(kept.triangles));
        count -= left_out;
      }
      __syncwarp();
      mark_corners(on_samples, row, kept.corners);
      left_out = warp_sum(left_out);
      if (lane_id() == 0 && left_out > 0) atomicAdd(&on_samples.left_out, left_out);
    }
    const std::uint32_t triangles = warp_sum(count),
                        vertices = warp_sum(is_patched ? tables.patches[patch].inner : 0u);
    if (lane_id() > 0 || cells == 0) continue;
    w.cells[row] = cells;
    w.triangles[row] = triangles;
    w.vertices[row] = vertices;
    BlockWord(w.any).store(1, cuda::memory_order_relaxed);
  }
  __syncthreads();
  if (w.any == 0) return;
  if (warp_id() == BlockConfig<N>::kVertices) {
    const std::uint32_t all = sum_rows(w.vertices);
    if (lane_id() == 0) w.own_vertices = all;
  }
  if (warp_id() == BlockConfig<N>::kTriangles) {
    const std::uint32_t all = sum_rows(w.triangles);
    if (lane_id() == 0) w.own_triangles = all;
  }
  __syncthreads();
}

}  // namespace isobrick::gpu
