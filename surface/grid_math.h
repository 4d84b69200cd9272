#pragma once

#include <cstdint>

#include "surface/lod_seam.h"

// A vertex of a grid's surface: arithmetic that both backends share verbatim.

namespace isobrick::grid {

struct Vertex {
  Vec3f position, normal;
  std::uint32_t faces;  ///< bit f: it lies on face f, where the grid meets a coarser one
};

/// In places along the axes, of point (x, y, z) of `around`.
ISOBRICK_HD inline Vec3f gradient(const GridView& g, int x, int y, int z) {
  const int row = g.around_n[0], plane = row * g.around_n[1];
  const float* at = g.around + (z * plane + y * row + x);
  const auto along = [&](int p, int n, int step, const float* inverse) {
    const float before = at[p > 0 ? -step : 0], after = at[p + 1 < n ? step : 0];
    return (after - before) * inverse[p];
  };
  return {along(x, g.around_n[0], 1, g.inverse[0]), along(y, g.around_n[1], row, g.inverse[1]),
          along(z, g.around_n[2], plane, g.inverse[2])};
}

ISOBRICK_HD inline float mix(float a, float b, float part) { return a + part * (b - a); }

/// The place of the vertex on the edge from a point along `axis`: `part` of the way from
/// point `below` on along each axis.
struct EdgePlace {
  int below[3];
  float part[3];
  bool on_point;  ///< all parts are 0

  /// Bit f: it lies on face f, where the grid meets a coarser one.
  ISOBRICK_HD std::uint32_t faces(const GridView& g) const {
    std::uint32_t faces = 0;
    for (int i = 0; i < 3; ++i)
      if (part[i] == 0) {
        if (below[i] == 0 && g.faces[2 * i].values) faces |= 1u << 2 * i;
        if (below[i] == g.n[i] - 1 && g.faces[2 * i + 1].values) faces |= 2u << 2 * i;
      }
    return faces;
  }
};

template <int axis>
ISOBRICK_HD inline EdgePlace place_on(const GridView& g, int x, int y, int z) {
  EdgePlace at{{x, y, z}, {0, 0, 0}, false};
  const float* value = g.at(x, y, z);
  const float t = edge_parameter(value[0],
                                 value[axis == 0   ? 1
                                       : axis == 1 ? g.row
                                                   : g.plane],
                                 0.0f);
  // Rounded so that vertices that float may put into one place are one place.
  at.part[axis] = static_cast<float>(static_cast<int>(t * 1048576.0f + 0.5f)) * (1.0f / 1048576.0f);
  if (at.part[axis] >= 1) {
    ++at.below[axis];
    at.part[axis] = 0;
  }
  at.on_point = at.part[axis] == 0;
  return at;
}

/// The vertex on the edge from point (x, y, z) of `values` along `axis`, whose ends lie on
/// different sides.
template <int axis>
ISOBRICK_HD inline Vertex vertex_on(const GridView& g, int x, int y, int z) {
  const EdgePlace at = place_on<axis>(g, x, y, z);
  const int ax = at.below[0] + g.shift[0], ay = at.below[1] + g.shift[1],
            az = at.below[2] + g.shift[2];
  double place[3] = {g.place[0][ax], g.place[1][ay], g.place[2][az]};
  Vec3f slope = gradient(g, ax, ay, az);
  if (!at.on_point) {
    const int along = axis == 0 ? ax : axis == 1 ? ay : az;
    const double next = g.place[axis][along + 1];
    place[axis] += static_cast<double>(at.part[axis]) * (next - place[axis]);
    const Vec3f end = gradient(g, ax + (axis == 0), ay + (axis == 1), az + (axis == 2));
    slope = {mix(slope.x, end.x, at.part[axis]), mix(slope.y, end.y, at.part[axis]),
             mix(slope.z, end.z, at.part[axis])};
  }
  // Where there is no gradient: from the edge's inside end to the other one; one direction
  // for all vertices on a point.
  const float up = at.on_point || *g.at(x, y, z) >= 0 ? -1.0f : 1.0f;
  const int way = at.on_point ? 0 : axis;
  const Vec3f instead{way == 0 ? up : 0.0f, way == 1 ? up : 0.0f, way == 2 ? up : 0.0f};

  Vertex vertex;
  vertex.normal = g.map.unit_normal(slope, instead);
  vertex.faces = at.faces(g);
  for (int f = 0; f < 6; ++f)
    if (vertex.faces >> f & 1) coarse::move_to_contour(g, f, at.below, at.part, place);
  const double* m = g.to_world;
  vertex.position = {
      static_cast<float>(m[0] * place[0] + (m[1] * place[1] + (m[2] * place[2] + g.offset[0]))),
      static_cast<float>(m[3] * place[0] + (m[4] * place[1] + (m[5] * place[2] + g.offset[1]))),
      static_cast<float>(m[6] * place[0] + (m[7] * place[1] + (m[8] * place[2] + g.offset[2])))};
  return vertex;
}

/// A seam strip's vertex beside a vertex of the border, to either side of the surface.
ISOBRICK_HD inline Vec3f beside(Vec3f position, Vec3f normal, float width) {
  return {position.x + normal.x * width, position.y + normal.y * width,
          position.z + normal.z * width};
}

}  // namespace isobrick::grid
