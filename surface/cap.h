#pragma once

#include <array>
#include <cstdint>

#include "surface/border_normal.h"
#include "surface/cap_bounds.h"
#include "surface/coincident_vertices.h"
#include "surface/patched_cells.h"
#include "surface/tile_kernels.h"

// Caps: what closes a surface at the border. A border face is a cell face between a cell that
// exists and one that does not. Its part inside is filled with polygons of the vertices on its
// edges, which the cell has, and of vertices on its samples. See docs/design/surface.md.

namespace isobrick::inline v0 {

/// The triangles that fill the part of a face inside. Corners are corner i of the face, i, or the
/// vertex on its edge from corner i to the next one, 4 + i. In the order of case_rule::kFaces.
struct CapPolygon {
  std::uint8_t triangles = 0;
  std::array<std::uint8_t, 12> corners{};
};

/// The polygons by the corners inside, as bits; where opposite corners are, + 16 for parts that
/// are not joined.
constexpr std::array<CapPolygon, 32> make_cap_polygons() {
  std::array<CapPolygon, 32> polygons{};
  for (int index = 0; index < 32; ++index) {
    const auto inside = [index](int i) { return (index >> i % 4 & 1) != 0; };
    CapPolygon& polygon = polygons[static_cast<std::size_t>(index)];
    std::size_t used = 0;
    const auto add = [&](int a, int b, int c) {
      for (const int corner : {a, b, c})
        polygon.corners[used++] = static_cast<std::uint8_t>(corner);
      ++polygon.triangles;
    };
    if (index == 16 + 5 || index == 16 + 10) {
      for (int i = 0; i < 4; ++i)
        if (inside(i)) add(4 + (i + 3) % 4, i, 4 + i);
      continue;
    }
    std::array<int, 8> loop{};
    int size = 0;
    for (int i = 0; i < 4; ++i) {
      if (inside(i)) loop[static_cast<std::size_t>(size++)] = i;
      if (inside(i) != inside(i + 1)) loop[static_cast<std::size_t>(size++)] = 4 + i;
    }
    for (int i = 2; i < size; ++i)
      add(loop[0], loop[static_cast<std::size_t>(i - 1)], loop[static_cast<std::size_t>(i)]);
  }
  return polygons;
}
inline constexpr auto kCapPolygons = make_cap_polygons();

/// Calls f(a, b, c) with the vertices of each triangle of a polygon on a face that is no degenerate
/// one, as coincident::vertex_on() names them; the number of the others. `at`: the coincident
/// vertices among the cell's corners, none where degenerate triangles stay.
template <class F>
constexpr std::uint32_t for_each_cap_triangle(std::uint32_t face, std::uint32_t polygon,
                                              std::uint32_t at, F&& f) {
  const auto& corners = case_rule::kFaces[face];
  const auto vertex = [&](std::uint8_t corner) -> int {
    const int c = corners[corner & 3];
    if (corner < 4) return c;
    return coincident::vertex_on(case_rule::edge_between(c, corners[(corner + 1) & 3]), at);
  };
  const CapPolygon& of = kCapPolygons[polygon];
  std::uint32_t left_out = 0;
  for (std::size_t t = 0; t < of.triangles; ++t) {
    const int a = vertex(of.corners[3 * t]), b = vertex(of.corners[3 * t + 1]),
              c = vertex(of.corners[3 * t + 2]);
    if (a != b && b != c && c != a)
      f(a, b, c);
    else
      ++left_out;
  }
  return left_out;
}

/// Whether a cell, each coordinate in −1 … 32, exists.
inline bool exists(const ExistingCells& cells, Index x, Index y, Index z) {
  return cells.at(static_cast<int>(y), static_cast<int>(z)) >> (x + 1) & 1;
}

/// Whether a face of a cell that exists is a border face.
inline bool is_border_face(const ExistingCells& cells, Int3 cell, int face) {
  cell[face / 2] += face % 2 != 0 ? 1 : -1;
  return !exists(cells, cell.x, cell.y, cell.z);
}

/// The polygon on a face of the cell at (x, y, z), whose corners inside are bits.
template <class T>
std::uint32_t polygon_of(const KernelContext& context, const TileState& tile, int x, int y, int z,
                         int face, std::uint32_t inside) {
  const auto& c = case_rule::kFaces[face];
  std::uint32_t polygon = 0;
  for (int i = 0; i < 4; ++i) polygon |= (inside >> c[i] & 1) << i;
  if (polygon != 5 && polygon != 10) return polygon;
  // Whether the inside is in one piece there, as the cell itself resolves it.
  const bool below = context.inside == Inside::below;
  bool joined = !below;
  if (context.trilinear) {
    const CellValues<T> values(reinterpret_cast<const T*>(tile.samples.data()), context.isovalue, x,
                               y, z);
    joined = cell_topology::joins_inside(values.d[c[0]], values.d[c[1]], values.d[c[2]],
                                         values.d[c[3]]) != below;
  }
  return joined ? polygon : polygon + 16;
}

/// After the other counts: finds the border faces, marks the samples that their triangles have
/// corners on, and completes the counts of triangles.
void count_cap(ScalarType type, const KernelContext& context, TileState& tile);

/// Of a surface with this map to world space.
AxisNormals axis_normals(const WorldMap& world, Inside inside);

}  // namespace isobrick
