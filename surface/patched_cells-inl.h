// Cells that follow the trilinear interpolant; included once for every SIMD target.

#if defined(ISOBRICK_PATCHED_CELLS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef ISOBRICK_PATCHED_CELLS_INL_H_
#undef ISOBRICK_PATCHED_CELLS_INL_H_
#else
#define ISOBRICK_PATCHED_CELLS_INL_H_
#endif

#include "surface/coincident_vertices-inl.h"
#include "surface/inner_vertices.h"
#include "surface/patched_cells.h"
#include "surface/tile_triangles-inl.h"

HWY_BEFORE_NAMESPACE();
namespace isobrick::inline v0 {
namespace HWY_NAMESPACE {

/// Writes the tile's inner vertices, in the order of their cells.
template <class T>
void write_inner_vertices(const KernelContext& context, const TileState& tile, Vec3f* positions,
                          Vec3f* normals) {
  const TopologyTables& tables = topology_tables();
  const ScalarVertices<T> scalar{context, tile};
  for (const PatchedCell& cell : tile.patched) {
    const CellPatch& patch = tables.patches[cell.patch];
    if (patch.inner == 0) continue;
    const int x = static_cast<int>(cell.cell & 31), y = static_cast<int>(cell.cell >> 5 & 31),
              z = static_cast<int>(cell.cell >> 10 & 31);
    CellValues<T> values(scalar.samples, context.isovalue, x, y, z);
    const double scale = cell_topology::scale_of(values.d);
    for (double& v : values.d) v *= scale;
    cell_topology::Necklace neck{};
    if (patch.diagonal >= 0) neck = cell_topology::necklace(values.d);
    const Int3 origin = tile.shape.origin + Int3{x, y, z};
    for (int n = 0; n < patch.inner; ++n) {
      const auto at = cell_topology::inner_vertex(patch, neck, values.d, n);
      Vec3f where{};
      for (int axis = 0; axis < 3; ++axis)
        where[axis] = static_cast<float>(origin[axis]) + static_cast<float>(at.p[axis]);
      *positions++ = context.world.position(where);
      if (!normals) continue;
      *normals++ = cell_topology::normal_within(context.world, values.d, at, [&](int c) {
        const Int3 corner{x + (c & 1), y + (c >> 1 & 1), z + (c >> 2)};
        const T* p = scalar.samples + TileLayout::offset(static_cast<int>(corner.x),
                                                         static_cast<int>(corner.y),
                                                         static_cast<int>(corner.z));
        return scalar.gradient(p, tile.shape.origin + corner);
      });
    }
  }
}

/// Writes the triangles of the patched cells.
inline void write_patched_triangles(bool mirrored, const TileState& tile, Triangle* out) {
  const TopologyTables& tables = topology_tables();
  const std::size_t second = mirrored ? 2 : 1, third = 3 - second;
  std::uint32_t inner = tile.number_base + tile.edge_vertices;
  CellNumbers numbers(tile);
  alignas(64) std::uint32_t ids[16];
  static_assert(kFirstInner + kMaxPatchInner <= 16);
  for (const PatchedCell& cell : tile.patched) {
    const CellPatch& patch = tables.patches[cell.patch];
    numbers.find(cell.cell, ids);
    for (std::uint32_t n = 0; n < patch.inner; ++n) ids[kFirstInner + n] = inner++;
    const std::uint8_t* corners = tables.corners + patch.first;
    for (int n = patch.triangles; n > 0; --n, corners += 3)
      *out++ = {ids[corners[0]], ids[corners[second]], ids[corners[third]]};
  }
}

/// The same, without degenerate triangles.
inline void write_kept_patched_triangles(bool mirrored, const TileState& tile, Triangle* out) {
  const TopologyTables& tables = topology_tables();
  std::uint32_t inner = tile.number_base + tile.edge_vertices;
  for (const PatchedCell& cell : tile.patched) {
    const CellPatch& patch = tables.patches[cell.patch];
    const int x = static_cast<int>(cell.cell & 31), y = static_cast<int>(cell.cell >> 5 & 31),
              z = static_cast<int>(cell.cell >> 10 & 31);
    const auto number = [&](int vertex) {
      if (vertex < 8) return sample_number(*tile.on_samples, x, y, z, vertex);
      const int corner = vertex - 8;
      return corner < kFirstInner ? edge_number(tile, x, y, z, corner)
                                  : inner + static_cast<std::uint32_t>(corner - kFirstInner);
    };
    coincident::for_each_kept(tables.corners + patch.first, patch.triangles,
                              coincident::corner_bits(tile.coincident->at, x, y, z),
                              [&](int a, int b, int c) {
                                *out++ = mirrored ? Triangle{number(a), number(c), number(b)}
                                                  : Triangle{number(a), number(b), number(c)};
                              });
    inner += patch.inner;
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace isobrick
HWY_AFTER_NAMESPACE();

#endif
