#pragma once

#include "gpu/tile/tile_cells.cuh"
#include "surface/cap.h"

// What closes a surface at the border: the border faces of a tile's cells and the triangles on
// them. The rules are those of surface/cap.h.

namespace isobrick::inline v0::gpu {

/// The polygons and the faces of a cell, as device memory has them.
struct CapTable {
  std::array<CapPolygon, 32> polygons;
  std::uint8_t corners[6][4], edges[6][4];  ///< of a face: edge i from corner i to the next
};
constexpr CapTable make_cap_table() {
  CapTable table{kCapPolygons, {}, {}};
  for (int f = 0; f < 6; ++f)
    for (int i = 0; i < 4; ++i) {
      const int a = case_rule::kFaces[f][i], b = case_rule::kFaces[f][(i + 1) % 4];
      table.corners[f][i] = static_cast<std::uint8_t>(a);
      table.edges[f][i] = static_cast<std::uint8_t>(case_rule::edge_between(a, b));
    }
  return table;
}
static __device__ const CapTable kCapTable = make_cap_table();

/// Vertex `i` of triangle `t` on a face, as vertex_on() names it.
__device__ inline std::uint32_t cap_vertex(int face, std::uint32_t polygon, std::uint32_t t, int i,
                                           std::uint32_t at) {
  const std::uint32_t corner =
      kCapTable.polygons[polygon].corners[3 * t + static_cast<std::uint32_t>(i)];
  return corner < 4 ? kCapTable.corners[face][corner]
                    : vertex_on(kCapTable.edges[face][corner & 3u], at);
}

/// What is kept of the triangles on a face.
__device__ inline KeptOfCell kept_of_face(int face, std::uint32_t polygon, std::uint32_t at) {
  KeptOfCell kept;
  const std::uint32_t n = kCapTable.polygons[polygon].triangles;
  for (std::uint32_t t = 0; t < n; ++t)
    kept.add(t, cap_vertex(face, polygon, t, 0, at), cap_vertex(face, polygon, t, 1, at),
             cap_vertex(face, polygon, t, 2, at));
  return kept;
}

/// The border faces of a cell that exists, as bits in the order of case_rule::kFaces.
__device__ inline std::uint32_t border_faces(const SampleWork& w, int x, int y, int z) {
  std::uint32_t faces = 0;
#pragma unroll
  for (int face = 0; face < 6; ++face) {
    const int step = face % 2 != 0 ? 1 : -1, axis = face / 2;
    faces |= (exists(w, x + (axis == 0 ? step : 0), y + (axis == 1 ? step : 0),
                     z + (axis == 2 ? step : 0))
                  ? 0u
                  : 1u)
             << face;
  }
  return faces;
}

/// The polygon on a face of the cell at (x, y, z), whose corners inside are bits.
template <class T, bool Trilinear>
__device__ inline std::uint32_t polygon_of(const TileShared& s, const TileParams& p, int x, int y,
                                           int z, int face, std::uint32_t inside) {
  const std::uint8_t(&c)[4] = kCapTable.corners[face];
  std::uint32_t polygon = 0;
#pragma unroll
  for (int i = 0; i < 4; ++i) polygon |= (inside >> c[i] & 1u) << i;
  if (polygon != 5 && polygon != 10) return polygon;
  bool joined = !p.on_samples.below;
  if constexpr (Trilinear) {
    double d[8];
    load_cell<T>(s, p, x, y, z, d);
    joined = cell_topology::joins_inside(d[c[0]], d[c[1]], d[c[2]], d[c[3]]) != p.on_samples.below;
  }
  return joined ? polygon : polygon + 16;
}

/// The corners of a cell on the side of the inside.
__device__ inline std::uint32_t corners_inside(const SampleWork& w, const TileParams& p, int x,
                                               int y, int z) {
  return corners_at(w.inside, x, y, z) ^ (p.on_samples.below ? 0xffu : 0u);
}

/// Which cells around the tile exist; notes whether any does not.
template <int N>
__device__ inline void find_cells_there(const NanRows& missing, SampleWork& w) {
  constexpr unsigned long long kAll = (1ull << kCellsAround) - 1;
  for (unsigned i = own_thread(); i < kCellsAround * kCellsAround; i += N) {
    const unsigned long long* row =
        missing.rows + i / kCellsAround * kEdgeAround + i % kCellsAround;
    const unsigned long long any = row[0] | row[1] | row[kEdgeAround] | row[kEdgeAround + 1];
    const unsigned long long there = ~(any | any >> 1) & kAll;
    w.there[i] = there;
    if (there != kAll) BlockWord(w.any_missing).store(1, cuda::memory_order_relaxed);
  }
}

/// Calls f(face, polygon, at, kept) for the border faces with triangles of the cell at (x, y, z).
template <class T, bool Trilinear, class F>
__device__ inline void for_each_cap_face(const TileShared& s, const TileParams& p,
                                         const SampleWork& w, int x, int y, int z, F&& f) {
  if (!exists(w, x, y, z)) return;
  const std::uint32_t faces = border_faces(w, x, y, z);
  if (faces == 0) return;
  const std::uint32_t inside = corners_inside(w, p, x, y, z), at = corners_at(w.at, x, y, z);
  if (inside == 0) return;
  for (int face = 0; face < 6; ++face) {
    if (!(faces >> face & 1u)) continue;
    const std::uint32_t polygon = polygon_of<T, Trilinear>(s, p, x, y, z, face, inside);
    f(face, polygon, at, kept_of_face(face, polygon, at));
  }
}

/// The cells of a row that are at the border and have a corner inside, as bits.
__device__ inline std::uint32_t border_cells(const SampleWork& w, const TileParams& p, int y,
                                             int z) {
  const unsigned long long there = cells_there(w, y, z);
  const unsigned long long around = there << 1 & there >> 1 & cells_there(w, y - 1, z) &
                                    cells_there(w, y + 1, z) & cells_there(w, y, z - 1) &
                                    cells_there(w, y, z + 1);
  const unsigned long long flip = p.on_samples.below ? ~0ull : 0ull;
  const unsigned long long* inside = w.inside + (z + 1) * kEdgeAround + y + 1;
  const unsigned long long any = (inside[0] ^ flip) | (inside[1] ^ flip) |
                                 (inside[kEdgeAround] ^ flip) | (inside[kEdgeAround + 1] ^ flip);
  return static_cast<std::uint32_t>((there & ~around & (any | any >> 1)) >> 1);
}

/// Counts the triangles of the tile's cap and marks the samples that they have vertices on.
template <int N, class T, bool Trilinear>
__device__ inline void count_cap(const TileShared& s, const TileParams& p, SampleWork& w) {
  for (auto row = static_cast<int>(own_thread()); row < kRowsOfTile; row += N) {
    const auto z = static_cast<int>(z_of_row(static_cast<std::uint32_t>(row))), y = row - 33 * z;
    w.border[row] = y < 32 && z < 32 ? border_cells(w, p, y, z) : 0;
    w.border_before[row] = static_cast<std::uint32_t>(__popc(w.border[row]));
  }
  __syncthreads();
  if (warp_id() == 0) {
    const std::uint32_t all = sum_rows(w.border_before);
    if (lane_id() == 0) w.all_border = all;
  }
  __syncthreads();
  for_each_bit<N>(w.border, w.border_before, w.all_border,
                  [&](std::uint32_t group, bool is_cell, int row, int x) {
                    const auto z = static_cast<int>(z_of_row(static_cast<std::uint32_t>(row))),
                               y = row - 33 * z;
                    std::uint32_t triangles = 0, left_out = 0, corners = 0;
                    if (is_cell)
                      for_each_cap_face<T, Trilinear>(
                          s, p, w, x, y, z,
                          [&](int, std::uint32_t polygon, std::uint32_t, const KeptOfCell& kept) {
                            const auto n = static_cast<std::uint32_t>(__popc(kept.triangles));
                            triangles += n;
                            left_out += kCapTable.polygons[polygon].triangles - n;
                            corners |= kept.corners;
                          });
                    mark_corners_of(w, row, x, corners);
                    __syncwarp();
                    triangles = warp_sum(triangles);
                    left_out = warp_sum(left_out);
                    if (lane_id() > 0) return;
                    w.cap[group] = triangles;
                    if (left_out > 0) atomicAdd(&w.left_out, left_out);
                  });
}

}  // namespace isobrick::gpu
