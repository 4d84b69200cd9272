#pragma once

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

}  // namespace isobrick::cell_topology
