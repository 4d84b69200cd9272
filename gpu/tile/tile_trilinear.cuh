#pragma once

#include "gpu/tile/tile_coincident.cuh"
#include "gpu/tile/tile_vertices.cuh"
#include "surface/inner_vertices.h"

// Where the surface follows the trilinear interpolant: which cells of a tile have another patch
// than their case, which vertices lie within them, and their triangles. The arithmetic is that of
// the CPU (surface/inner_vertices.h).

namespace isobrick::inline v0::gpu {

__device__ inline TrilinearWork& trilinear_work(const TileParams& p) {
  return p.trilinear.work[blockIdx.x];
}

/// The corners of the cell at (x, y, z) less the isovalue.
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

/// Between classify_tile() and count_tile(): finds the cells, a row a warp, and counts what they
/// make.
template <int N, class T, bool Nan>
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
    const std::uint32_t triangles = warp_sum(is_patched ? tables.patches[patch].triangles : 0u),
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

/// A cell of a row, each thread of a warp another one.
struct PatchedCellOfRow {
  int x, y, z, row;
  CellPatch patch;         ///< empty where the cell is not patched
  std::uint32_t vertices;  ///< the number in the tile of the cell's first vertex among such

  __device__ PatchedCellOfRow(const TrilinearWork& w, const TopologyTables& tables, int r)
      : x(static_cast<int>(lane_id())), y(r % 32), z(r / 32), row(33 * z + y) {
    if (w.cells[row] >> x & 1u) patch = tables.patches[w.patches[32 * r + x]];
    vertices = w.vertices[row] + (warp_inclusive_sum(patch.inner) - patch.inner);
  }
};

/// A row a warp, a cell a thread.
template <int N, class T, bool Normals>
__device__ inline void write_inner_vertices(const TileShared& s, const TileParams& p) {
  const TrilinearWork& w = trilinear_work(p);
  const std::uint64_t first = s.vertex_base + s.all_vertices;
  if (s.extra_vertices == 0 || first + s.extra_vertices > p.vertex_capacity) return;
  using Maker = VertexMaker<T>;
  const Maker maker{s, p, static_cast<typename Maker::R>(p.isovalue)};
  for (auto r = static_cast<int>(warp_id()); r < 32 * 32; r += BlockConfig<N>::kWarps) {
    if (w.cells[33 * (r / 32) + r % 32] == 0) continue;
    const PatchedCellOfRow cell(w, *p.trilinear.tables, r);
    if (cell.patch.inner == 0) continue;
    double d[8];
    load_cell<T>(s, p, cell.x, cell.y, cell.z, d);
    const double scale = cell_topology::scale_of(d);
    for (double& v : d) v *= scale;
    cell_topology::Necklace neck{};
    if (cell.patch.diagonal >= 0) neck = cell_topology::necklace(d);
    for (int n = 0; n < cell.patch.inner; ++n) {
      const auto at = cell_topology::inner_vertex(cell.patch, neck, d, n);
      const std::uint64_t i = first + cell.vertices + static_cast<std::uint32_t>(n);
      const auto along = [&](int axis, int of_cell) {
        return static_cast<float>(s.shape.origin[axis] + of_cell) + static_cast<float>(at.p[axis]);
      };
      store_once(p.positions[i],
                 position_of(p, {along(0, cell.x), along(1, cell.y), along(2, cell.z)}));
      if constexpr (Normals)
        store_once(p.normals[i], cell_topology::normal_within(p.world, d, at, [&](int c) {
                     const int cx = cell.x + (c & 1), cy = cell.y + (c >> 1 & 1),
                               cz = cell.z + (c >> 2);
                     return maker.gradient(cx, cy, cz, maker.sample(cx, cy, cz));
                   }));
    }
  }
}

/// A row a warp, a cell a thread.
template <int N>
__device__ inline void write_patched_triangles(const TileShared& s, const TileParams& p) {
  const TrilinearWork& w = trilinear_work(p);
  if (w.own_triangles == 0 || s.triangle_base + s.all_triangles > p.triangle_capacity) return;
  const TopologyTables& tables = *p.trilinear.tables;
  Triangle* const first = p.triangles + s.triangle_base + (s.all_triangles - w.own_triangles);
  const auto places = static_cast<std::uint32_t>(__cvta_generic_to_shared(s.places));
  const int second = p.world.mirrored ? 2 : 1;
  for (auto r = static_cast<int>(warp_id()); r < 32 * 32; r += BlockConfig<N>::kWarps) {
    if (w.cells[33 * (r / 32) + r % 32] == 0) continue;
    const PatchedCellOfRow cell(w, tables, r);
    const std::uint32_t count = cell.patch.triangles;
    Triangle* to = first + w.triangles[cell.row] + (warp_inclusive_sum(count) - count);
    const auto x = static_cast<std::uint32_t>(cell.x);
    const std::uint32_t of_x = places_of(s, places, x), mask = low_bits(x),
                        inner = s.number_base + s.all_vertices + cell.vertices;
    const std::uint8_t* corners = tables.corners + cell.patch.first;
    for (std::uint32_t t = 0; t < count; ++t, ++to, corners += 3)
      for (int c = 0; c < 3; ++c) {
        const std::uint32_t corner = corners[c == 0 ? 0 : c == 1 ? second : 3 - second];
        const std::uint32_t number =
            corner < kFirstInner ? number_on_edge(s, 8 * corner | of_x,
                                                  4 * static_cast<std::uint32_t>(cell.row), mask)
                                 : inner + (corner - kFirstInner);
        __stcs(&(*to)[static_cast<std::size_t>(c)], number);
      }
  }
}

template <int N, class T, bool Normals>
__device__ inline void write_patched(const TileShared& s, const TileParams& p) {
  write_inner_vertices<N, T, Normals>(s, p);
  write_patched_triangles<N>(s, p);
  __syncthreads();  // the first warp takes the next tile, and others still asked for this one
}

}  // namespace isobrick::gpu
