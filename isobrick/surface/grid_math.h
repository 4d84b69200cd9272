#pragma once

#include <cstdint>

#include "isobrick/surface/coarse_face.h"

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

/// The vertex on the edge from point (x, y, z) of `values` along `axis`, whose ends lie on
/// different sides.
template <int axis>
ISOBRICK_HD inline Vertex vertex_on(const GridView& g, int x, int y, int z) {
  int below[3] = {x, y, z};
  const int step = axis == 0 ? 1 : axis == 1 ? g.row : g.plane;
  const float* value = g.at(x, y, z);
  // Rounded so that vertices that float may put into one place are one place.
  float part[3] = {0, 0, 0};
  const float t = crossing(value[0], value[step], 0.0f);
  part[axis] = static_cast<float>(static_cast<int>(t * 1048576.0f + 0.5f)) * (1.0f / 1048576.0f);
  const bool upper_inside = value[step] >= 0;
  if (part[axis] >= 1) {
    ++below[axis];
    part[axis] = 0;
  }
  const bool on_point = part[axis] == 0;

  const int ax = below[0] + g.shift[0], ay = below[1] + g.shift[1], az = below[2] + g.shift[2];
  double place[3] = {g.place[0][ax], g.place[1][ay], g.place[2][az]};
  Vec3f slope = gradient(g, ax, ay, az);
  if (!on_point) {
    const int at = axis == 0 ? ax : axis == 1 ? ay : az;
    const double next = g.place[axis][at + 1];
    place[axis] += static_cast<double>(part[axis]) * (next - place[axis]);
    const Vec3f end = gradient(g, ax + (axis == 0), ay + (axis == 1), az + (axis == 2));
    slope = {mix(slope.x, end.x, part[axis]), mix(slope.y, end.y, part[axis]),
             mix(slope.z, end.z, part[axis])};
  }
  // Where there is no gradient: from the edge's inside end to the other one; one direction
  // for all vertices on a point.
  const float up = on_point || !upper_inside ? -1.0f : 1.0f;
  const int way = on_point ? 0 : axis;
  const Vec3f instead{way == 0 ? up : 0.0f, way == 1 ? up : 0.0f, way == 2 ? up : 0.0f};

  Vertex vertex;
  vertex.normal = g.map.unit_normal(slope, instead);
  vertex.faces = 0;
  for (int i = 0; i < 3; ++i)
    if (part[i] == 0) {
      if (below[i] == 0 && g.faces[2 * i].values) vertex.faces |= 1u << 2 * i;
      if (below[i] == g.n[i] - 1 && g.faces[2 * i + 1].values) vertex.faces |= 2u << 2 * i;
    }
  for (int f = 0; f < 6; ++f)
    if (vertex.faces >> f & 1) coarse::move_to_contour(g, f, below, part, place);
  const double* m = g.to_world;
  const auto world = [&](int i) {
    const double* r = m + 3 * i;
    return static_cast<float>(r[0] * place[0] +
                              (r[1] * place[1] + (r[2] * place[2] + g.offset[i])));
  };
  vertex.position = {world(0), world(1), world(2)};
  return vertex;
}

/// A ribbon's vertex beside a vertex of the border, to either side of the surface.
ISOBRICK_HD inline Vec3f beside(Vec3f position, Vec3f normal, float width) {
  return {position.x + normal.x * width, position.y + normal.y * width,
          position.z + normal.z * width};
}

}  // namespace isobrick::grid
