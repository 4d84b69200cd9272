#pragma once

#include "gpu/tile/on_samples_mesh.cuh"
#include "gpu/tile/tile_trilinear.cuh"
#include "gpu/tile/tile_vertices.cuh"
#include "surface/inner_vertices.h"

// The vertices within the cells that follow the trilinear interpolant, and the triangles of those.
// The arithmetic is that of the CPU (surface/inner_vertices.h).

namespace isobrick::inline v0::gpu {

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
  if (w.own_vertices == 0 || first + s.extra_vertices > p.vertex_capacity) return;
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

/// A row a warp, a cell a thread. `behind`: the tile's triangles behind these. `OnSamples`: the
/// mesh has vertices on samples.
template <int N, bool OnSamples>
__device__ inline void write_patched_triangles(const TileShared& s, const TileParams& p,
                                               std::uint32_t behind) {
  const TrilinearWork& w = trilinear_work(p);
  if (w.own_triangles == 0 || s.triangle_base + s.all_triangles > p.triangle_capacity) return;
  const TopologyTables& tables = *p.trilinear.tables;
  Triangle* const first =
      p.triangles + s.triangle_base + (s.all_triangles - behind - w.own_triangles);
  const auto places = static_cast<std::uint32_t>(__cvta_generic_to_shared(s.places));
  const int second = p.world.mirrored ? 2 : 1;
  for (auto r = static_cast<int>(warp_id()); r < 32 * 32; r += BlockConfig<N>::kWarps) {
    if (w.cells[33 * (r / 32) + r % 32] == 0) continue;
    const PatchedCellOfRow cell(w, tables, r);
    std::uint32_t count = cell.patch.triangles, kept = (1u << count) - 1, at = 0;
    if constexpr (OnSamples) {
      if (count > 0 && sample_work(p).any_at)
        at = corners_at(sample_work(p).at, cell.x, cell.y, cell.z);
      if (at != 0) kept = kept_of_patch(tables, cell.patch, at).triangles;
      count = static_cast<std::uint32_t>(__popc(kept));
      __syncwarp();
    }
    Triangle* to = first + w.triangles[cell.row] + (warp_inclusive_sum(count) - count);
    const auto x = static_cast<std::uint32_t>(cell.x);
    const std::uint32_t of_x = places_of(s, places, x), mask = low_bits(x),
                        inner = s.number_base + s.all_vertices + cell.vertices;
    const auto number_of = [&](std::uint32_t corner) {
      if (corner >= kFirstInner) return inner + (corner - kFirstInner);
      if constexpr (OnSamples)
        if (const std::uint32_t on = vertex_on(corner, at); on < 8)
          return VertexNumbers(s, p, cell.row, cell.x)(on);
      return number_on_edge(s, 8 * corner | of_x, 4 * static_cast<std::uint32_t>(cell.row), mask);
    };
    const std::uint8_t* corners = tables.corners + cell.patch.first;
    for (; kept; kept >>= 1, corners += 3) {
      if (!(kept & 1u)) continue;
      for (int c = 0; c < 3; ++c)
        __stcs(&(*to)[static_cast<std::size_t>(c)], number_of(corners[c == 0   ? 0
                                                                      : c == 1 ? second
                                                                               : 3 - second]));
      ++to;
    }
  }
}

}  // namespace isobrick::gpu
