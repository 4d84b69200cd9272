#pragma once

#include <type_traits>

#include <isobrick/vec.h>
#include "surface/cell_math.h"
#include "surface/cell_topology.h"

// Where the inner vertices of a cell's patch lie. Arithmetic that both backends can share verbatim.

namespace isobrick::inline v0::cell_topology {

/// A place in a cell, each coordinate in 0 … 1.
struct CellPoint {
  double p[3];
};

/// The trilinear weight of a corner at a place.
ISOBRICK_HD inline double weight_of(int corner, const CellPoint& at) {
  return (corner & 1 ? at.p[0] : 1 - at.p[0]) * (corner & 2 ? at.p[1] : 1 - at.p[1]) *
         (corner & 4 ? at.p[2] : 1 - at.p[2]);
}

ISOBRICK_HD inline double value_at(const double (&d)[8], const CellPoint& at) {
  double sum = 0;
  for (int c = 0; c < 8; ++c) sum += d[c] * weight_of(c, at);
  return sum;
}

/// The gradient of the interpolant.
ISOBRICK_HD inline CellPoint gradient_at(const double (&d)[8], const CellPoint& at) {
  CellPoint g{};
  for (int axis = 0; axis < 3; ++axis) {
    CellPoint low = at, high = at;
    low.p[axis] = 0;
    high.p[axis] = 1;
    g.p[axis] = value_at(d, high) - value_at(d, low);
  }
  return g;
}

/// Moves a place towards the surface along the gradient, within the cell.
ISOBRICK_HD inline CellPoint moved_to_surface(const double (&d)[8], CellPoint at) {
  constexpr double margin = 1.0 / 64;
  double value = value_at(d, at);
  for (int step = 0; step < 8; ++step) {
    const CellPoint g = gradient_at(d, at);
    const double length2 = g.p[0] * g.p[0] + (g.p[1] * g.p[1] + g.p[2] * g.p[2]);
    if (!(length2 > 0)) break;
    CellPoint next = at;
    for (int axis = 0; axis < 3; ++axis) {
      const double moved = at.p[axis] - value / length2 * g.p[axis];
      next.p[axis] = moved < margin ? margin : moved > 1 - margin ? 1 - margin : moved;
    }
    const double reached = value_at(d, next);
    if (!(std::fabs(reached) < std::fabs(value))) break;
    at = next;
    value = reached;
  }
  return at;
}

/// The middle of the vertices on these edges, moved to the surface.
ISOBRICK_HD inline CellPoint centre_of(const double (&d)[8], unsigned edges) {
  CellPoint sum{};
  int count = 0;
  for (int e = 0; e < 12; ++e) {
    if (!(edges >> e & 1)) continue;
    const int axis = e / 4, i = e & 1, j = e >> 1 & 1;
    const int first = axis == 0 ? 2 * i + 4 * j : axis == 1 ? i + 4 * j : i + 2 * j;
    const double a = d[first], b = d[first + (1 << axis)];
    const double t = a != b ? a / (a - b) : 0.5;  // what is tiny beside the rest may be lost
    for (int k = 0; k < 3; ++k) sum.p[k] += k == axis ? t : static_cast<double>(first >> k & 1);
    ++count;
  }
  for (double& v : sum.p) v /= count;
  return moved_to_surface(d, sum);
}

/// The place of inner vertex n of a patch. `d` is scaled so that products of four do not overflow;
/// `neck` matters for a tunnel only.
ISOBRICK_HD inline CellPoint inner_vertex(const CellPatch& patch, const Necklace& neck,
                                          const double (&d)[8], int n) {
  if (patch.diagonal < 0) return centre_of(d, patch.centre[n]);
  if (n >= 3) return centre_of(d, patch.centre[n - 3]);
  const int corner = patch.diagonal ^ 1 << n;
  CellPoint at{};
  for (int axis = 0; axis < 3; ++axis)
    at.p[axis] = corner >> axis & 1 ? neck.high[axis] : neck.low[axis];
  return at;
}

/// The normal at a place in the cell: of the corners' gradients, interpolated. Where these vanish
/// or are no numbers, of the interpolant's own gradient. `gradient_of(corner)` is in samples.
template <class GradientOf>
ISOBRICK_HD inline Vec3f normal_within(const WorldMap& world, const double (&d)[8],
                                       const CellPoint& at, const GradientOf& gradient_of) {
  Vec3f g{0, 0, 0};
  for (int c = 0; c < 8; ++c) {
    const Vec3f of_corner = gradient_of(c);
    const auto weight = static_cast<float>(weight_of(c, at));
    g.x += weight * of_corner.x;
    g.y += weight * of_corner.y;
    g.z += weight * of_corner.z;
  }
  const CellPoint own = gradient_at(d, at);
  double size = 0;
  for (const double v : own.p) size = std::fmax(size, std::fabs(v));
  Vec3f fallback{0, 0, 1};
  if (size > 0)
    fallback = {static_cast<float>(own.p[0] / size), static_cast<float>(own.p[1] / size),
                static_cast<float>(own.p[2] / size)};
  return world.unit_normal(g, fallback);
}

/// The corners of a cell less the isovalue, in the order of its corners. `sample(corner)` has the
/// sample's own type.
template <class T, class Sample>
ISOBRICK_HD inline void load_values(double (&d)[8], double isovalue, const Sample& sample) {
  for (int c = 0; c < 8; ++c) {
    const auto v = static_cast<double>(sample(c));
    // The isovalue of an active cell of integers is finite.
    d[c] = std::is_integral_v<T> ? v - isovalue : above_isovalue(v, isovalue);
  }
}

}  // namespace isobrick::cell_topology
