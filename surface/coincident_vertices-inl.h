// The triangles of cells with coincident vertices; included once for every SIMD target.

#if defined(ISOBRICK_COINCIDENT_VERTICES_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef ISOBRICK_COINCIDENT_VERTICES_INL_H_
#undef ISOBRICK_COINCIDENT_VERTICES_INL_H_
#else
#define ISOBRICK_COINCIDENT_VERTICES_INL_H_
#endif

#include <bit>

#include "surface/coincident_vertices.h"
#include "surface/sample_vertices-inl.h"

HWY_BEFORE_NAMESPACE();
namespace isobrick::inline v0 {
namespace HWY_NAMESPACE {

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

/// Writes the triangles of cells with a coincident vertex.
inline void write_kept_triangles(const CaseTables& tables, const TileState& tile, Triangle* out) {
  const CoincidentVertices& coincident = *tile.coincident;
  for (const ActiveCell cell : coincident.cells) {
    const int x = static_cast<int>(cell & 31), y = static_cast<int>(cell >> 5 & 31),
              z = static_cast<int>(cell >> 10 & 31);
    const auto number = [&](int vertex) {
      return vertex < 8 ? sample_number(*tile.on_samples, x, y, z, vertex)
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
