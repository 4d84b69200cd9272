#pragma once

#include "gpu/tile/tile_cells.cuh"

// Where degenerate triangles are left out: which cells have coincident vertices, which of their
// triangles are kept. The rules are those of surface/coincident_vertices.h.

namespace isobrick::inline v0::gpu {

/// What is kept of a cell of the table of cases.
__device__ inline KeptOfCell kept_of_case(const CaseTable& cases, std::uint32_t index,
                                          std::uint32_t at) {
  KeptOfCell kept;
  const std::uint32_t n = cases.triangle_count[index];
  for (std::uint32_t t = 0; t < n; ++t) {
    const std::uint32_t edges = cases.triangles[5 * index + t];
    kept.add(t, vertex_on(edges >> 3 & 15u, at), vertex_on(edges >> 7 & 15u, at),
             vertex_on(edges >> 11 & 15u, at));
  }
  return kept;
}

/// Goes through the active cells with coincident vertices: what they keep, and what that uses.
/// Patched cells are seen to elsewhere. A row a warp.
template <int N, bool Trilinear>
__device__ inline void mark_coincident(const TileShared& s, const TileParams& p, SampleWork& w) {
  const int x = static_cast<int>(lane_id());
  for (auto r = static_cast<int>(warp_id()); r < 32 * 32; r += BlockConfig<N>::kWarps) {
    const int y = r % 32, z = r / 32, row = 33 * z + y;
    const std::uint32_t at = corners_at(w.at, x, y, z);
    if (!__any_sync(kFullMask, at != 0)) continue;
    const std::uint32_t index = corners_at(w.inside, x, y, z);
    const std::uint32_t all = s.cases.triangle_count[index];
    bool counts = at != 0 && all > 0 && exists(w, x, y, z);
    if constexpr (Trilinear) counts = counts && !(trilinear_work(p).cells[row] >> x & 1u);
    const KeptOfCell kept = counts ? kept_of_case(s.cases, index, at) : KeptOfCell();
    const auto n = static_cast<std::uint32_t>(__popc(kept.triangles));
    const std::uint32_t cells = __ballot_sync(kFullMask, counts);
    const std::uint32_t triangles = warp_sum(n), left_out = warp_sum(counts ? all - n : 0);
    mark_corners(w, row, kept.corners);
    if (lane_id() > 0) continue;
    w.cells[row] = cells;
    w.triangles[row] = triangles;
    if (left_out > 0) atomicAdd(&w.left_out, left_out);
  }
}

/// Leaves out the edges with a coincident vertex at an end, and the cells with one.
__device__ inline void leave_out_coincident(const SampleWork& w, int y, int z, RowEdges& e) {
  const unsigned long long* row = w.at + (z + 1) * kEdgeAround + y + 1;
  const unsigned long long here = row[0] >> 1, along_y = here | row[1] >> 1,
                           along_z = here | row[kEdgeAround] >> 1;
  e.x &= ~static_cast<std::uint32_t>(here | here >> 1);
  e.y &= ~static_cast<std::uint32_t>(along_y >> 1);
  e.z &= ~static_cast<std::uint32_t>(along_z >> 1);
  e.y_at_0 &= ~static_cast<std::uint32_t>(along_y & 1u);
  e.z_at_0 &= ~static_cast<std::uint32_t>(along_z & 1u);
  e.cells &= ~w.cells[33 * z + y];
}

}  // namespace isobrick::gpu
