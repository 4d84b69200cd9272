// Coincident vertices, where degenerate triangles are left out; included once for every SIMD
// target.

#if defined(ISOBRICK_COINCIDENT_VERTICES_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef ISOBRICK_COINCIDENT_VERTICES_INL_H_
#undef ISOBRICK_COINCIDENT_VERTICES_INL_H_
#else
#define ISOBRICK_COINCIDENT_VERTICES_INL_H_
#endif

#include <bit>

#include "surface/coincident_vertices.h"
#include "surface/tile_vertices-inl.h"

HWY_BEFORE_NAMESPACE();
namespace isobrick::inline v0 {
namespace HWY_NAMESPACE {

/// Writes the tile's own vertices on coincident vertices. Their normals are those of the samples.
template <class T>
void write_coincident_vertices(const KernelContext& context, const TileState& tile,
                               Vec3f* positions, Vec3f* normals) {
  const ScalarVertices<T> scalar{context, tile};
  for (const SampleVertex& vertex : tile.coincident->vertices) {
    if (vertex.owner != SampleVertex::kOwn) continue;
    scalar.write_sample(vertex.place, positions++, normals);
    if (normals) ++normals;
  }
}

/// The number of the vertex on an active edge of the cell at (x, y, z).
inline std::uint32_t edge_number(const TileState& tile, int x, int y, int z, int edge) {
  const int axis = edge / 4, i = edge & 1, j = edge >> 1 & 1;
  const auto count = [](std::uint32_t word, int bits) {
    return static_cast<std::uint32_t>(std::popcount(word & ((std::uint32_t{1} << bits) - 1)));
  };
  if (axis == 0) {
    const EdgeRow& row = tile.rows[row_index(y + i, z + j)];
    return row.x_base + count(row.x, x);
  }
  const int sample = x + i;
  const EdgeRow& row = tile.rows[axis == 1 ? row_index(y, z + j) : row_index(y + j, z)];
  if (sample == 0) return axis == 1 ? row.y_at_0 : row.z_at_0;
  return axis == 1 ? row.y_base + count(row.y, sample - 1) : row.z_base + count(row.z, sample - 1);
}

/// The number of the vertex on corner `corner` of the cell at (x, y, z), a used coincident vertex.
inline std::uint32_t coincident_number(const CoincidentVertices& coincident, int x, int y, int z,
                                       int corner) {
  const int row = row_index(y + (corner >> 1 & 1), z + (corner >> 2));
  const std::uint64_t before = (std::uint64_t{1} << (x + (corner & 1))) - 1;
  return coincident
      .vertices[coincident.first[row] +
                static_cast<std::uint32_t>(std::popcount(coincident.used[row] & before))]
      .number;
}

/// Writes the triangles of cells with a coincident vertex.
inline void write_kept_triangles(const CaseTables& tables, const TileState& tile, Triangle* out) {
  const CoincidentVertices& coincident = *tile.coincident;
  for (const ActiveCell cell : coincident.cells) {
    const int x = static_cast<int>(cell & 31), y = static_cast<int>(cell >> 5 & 31),
              z = static_cast<int>(cell >> 10 & 31);
    const auto number = [&](int vertex) {
      return vertex < 8 ? coincident_number(coincident, x, y, z, vertex)
                        : edge_number(tile, x, y, z, vertex - 8);
    };
    coincident::for_each_kept(tables, cell >> 16, coincident::corner_bits(coincident.at, x, y, z),
                              [&](int a, int b, int c) {
                                *out++ = {number(a), number(b), number(c)};
                              });
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace isobrick
HWY_AFTER_NAMESPACE();

#endif
