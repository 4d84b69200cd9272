#pragma once

#include <array>
#include <cstdint>

#include "surface/boundary_map.h"
#include "surface/cap_bounds.h"
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

/// After the other counts: finds the border faces and their vertices on samples, the tile that
/// makes each one, and completes the counts. `unwelded`: no tile shares vertices with another.
void count_cap(ScalarType type, const KernelContext& context, bool unwelded, TileState& tile);

/// Copies the tile's own vertices that others may use to its boundary.
void publish_cap(const KernelContext& context, TileState& tile);

/// Turns the numbers of the cap's vertices into those of the mesh.
void adopt_cap(TileState& tile, const BoundaryMap& map);

/// Writes the tile's own vertices of the cap, and their normals unless null. A normal is the sum of
/// those of the border faces around the sample.
void write_cap_vertices(const KernelContext& context, const TileState& tile, Vec3f* positions,
                        Vec3f* normals);

}  // namespace isobrick
