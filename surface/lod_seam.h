#pragma once

#include <cmath>
#include <limits>

#include "surface/grid_view.h"

// Where a vertex on a face belongs on the other, coarser side: arithmetic that both
// backends share verbatim.

namespace isobrick::coarse {

/// A place on a face, in cells of the coarser grid.
struct Point {
  double u, v;
};

/// A cell of a face: corners (0,0), (1,0), (0,1), (1,1), edges bottom, right, top, left.
struct Cell {
  float v[4];

  ISOBRICK_HD bool inside(int corner) const { return v[corner] >= 0; }
  // The corners of an edge, the edges of a corner: two bits each.
  ISOBRICK_HD static int low(int edge) { return 0x24 >> 2 * edge & 3; }
  ISOBRICK_HD static int high(int edge) { return 0xBD >> 2 * edge & 3; }
  ISOBRICK_HD static int one_edge(int corner) { return 0x60 >> 2 * corner & 3; }
  ISOBRICK_HD static int other_edge(int corner) { return 0xB7 >> 2 * corner & 3; }

  ISOBRICK_HD bool crosses(int edge) const { return inside(low(edge)) != inside(high(edge)); }
  ISOBRICK_HD bool ambiguous() const {
    return inside(0) == inside(3) && inside(1) == inside(2) && inside(0) != inside(1);
  }
  /// Where the contour crosses an edge.
  ISOBRICK_HD Point edge_point(int edge) const {
    const double a = static_cast<double>(v[low(edge)]), b = static_cast<double>(v[high(edge)]);
    const double d = a - b, most = std::numeric_limits<double>::max();
    const double t = d >= -most && d <= most ? a / d : 0.5;
    if (edge == 0) return {t, 0};
    if (edge == 1) return {1, t};
    if (edge == 2) return {t, 1};
    return {0, t};
  }
  /// The edge at the other end of the contour that crosses `edge`: around an outside
  /// corner where there are two (the inside stays connected).
  ISOBRICK_HD int partner(int edge) const {
    if (!ambiguous()) {
      for (int other = 0; other < 4; ++other)
        if (other != edge && crosses(other)) return other;
      return edge;
    }
    for (int corner = 0; corner < 4; ++corner)
      if (!inside(corner)) {
        if (one_edge(corner) == edge) return other_edge(corner);
        if (other_edge(corner) == edge) return one_edge(corner);
      }
    return edge;
  }
};

/// The point of the segment a … b nearest to p, and its distance squared.
struct Nearest {
  Point point;
  double distance2;
};
ISOBRICK_HD inline Nearest nearest_on(Point a, Point b, Point p) {
  const double dx = b.u - a.u, dy = b.v - a.v, length2 = dx * dx + dy * dy;
  double t = length2 > 0 ? ((p.u - a.u) * dx + (p.v - a.v) * dy) / length2 : 0;
  t = t < 0 ? 0 : t > 1 ? 1 : t;
  const Point q{a.u + t * dx, a.v + t * dy};
  return {q, (q.u - p.u) * (q.u - p.u) + (q.v - p.v) * (q.v - p.v)};
}

/// Whether a place along an axis, `part` of the way from point `below` on, lies strictly
/// between two points of the coarser grid.
ISOBRICK_HD inline bool between(const GridView& g, int axis, int below, float part) {
  if (part > 0) return true;
  if (below % g.ratio[axis] == 0) return false;
  const double* coarse = g.coarse_place[axis] + below / g.ratio[axis];
  return g.place[axis][below + g.shift[axis]] < coarse[1];
}

/// Which of two contours in an ambiguous cell crosses the fine edge from point `below` on: the
/// one that ends on the cell's edge `near`. −1: either may be.
ISOBRICK_HD inline int near_edge(const GridView& g, int u, int v, const int (&below)[3],
                                 const float (&part)[3]) {
  if (g.ratio[u] == 2 && g.ratio[v] == 2) {
    // The fine edge goes from the cell's middle, which is inside, to that of an edge.
    if (part[v] > 0) return below[v] % 2 ? 2 : 0;
    return part[u] > 0 ? (below[u] % 2 ? 1 : 3) : -1;
  }
  // It goes between the middles of opposite edges: around the outside corner of the one whose
  // middle is outside.
  const bool inside = *g.at(below[0], below[1], below[2]) >= 0;
  if (part[v] > 0 && g.ratio[v] == 1) return inside ? 2 : 0;
  return part[u] > 0 && g.ratio[u] == 1 ? (inside ? 1 : 3) : -1;
}

/// A vertex on an edge of the coarser grid along `u`, in two halves of which the finer grid has
/// it: where the coarser side has it.
ISOBRICK_HD inline void move_on_edge(const GridView& g, int face, int u, int v,
                                     const int (&below)[3], double (&place)[3]) {
  const LodSeam& coarse = g.faces[face];
  const bool first = (face / 2 == 0 ? 1 : 0) == u;  // whether u is the face's first axis
  const int i = below[u] / g.ratio[u];
  const int j = (below[v] + g.ratio[v] - 1) / g.ratio[v];  // the last row may be cut short
  const float* at = coarse.values + (first ? j * coarse.n[0] + i : i * coarse.n[0] + j);
  const float a = at[0], b = at[first ? 1 : coarse.n[0]];
  if ((a >= 0) == (b >= 0)) return;
  const float t = edge_parameter(a, b, 0.0f);
  const float part =
      static_cast<float>(static_cast<int>(t * 1048576.0f + 0.5f)) * (1.0f / 1048576.0f);
  const double* ends = g.coarse_place[u] + i;
  place[u] = ends[0] + static_cast<double>(part) * (ends[1] - ends[0]);
}

/// A vertex on face `face` (2 · axis + side), `part` of the way from point `below` on, at
/// `place`: `place` is moved onto the contour of the coarser side, or to where that crosses the
/// edge of the coarser grid that the vertex is on.
ISOBRICK_HD inline void move_to_contour(const GridView& g, int face, const int (&below)[3],
                                        const float (&part)[3], double (&place)[3]) {
  const int normal = face / 2, u = normal == 0 ? 1 : 0, v = normal == 2 ? 1 : 2;
  const bool between_u = between(g, u, below[u], part[u]);
  const bool between_v = between(g, v, below[v], part[v]);
  if (between_u && !between_v && g.ratio[u] == 2) return move_on_edge(g, face, u, v, below, place);
  if (between_v && !between_u && g.ratio[v] == 2) return move_on_edge(g, face, v, u, below, place);
  if (!between_u || !between_v) return;
  const LodSeam& coarse = g.faces[face];
  const int i = below[u] / g.ratio[u], j = below[v] / g.ratio[v];
  const double from_u = g.coarse_place[u][i], from_v = g.coarse_place[v][j];
  const double length_u = g.coarse_place[u][i + 1] - from_u;
  const double length_v = g.coarse_place[v][j + 1] - from_v;
  const Point at{(place[u] - from_u) / length_u, (place[v] - from_v) / length_v};
  const float* row = coarse.values + (j * coarse.n[0] + i);
  const Cell cell{{row[0], row[1], row[coarse.n[0]], row[coarse.n[0] + 1]}};
  const int near = cell.ambiguous() ? near_edge(g, u, v, below, part) : -1;
  Nearest best{at, std::numeric_limits<double>::infinity()};
  for (int edge = 0; edge < 4; ++edge) {
    if (!cell.crosses(edge) || (near >= 0 && edge != near)) continue;
    const Nearest found =
        nearest_on(cell.edge_point(edge), cell.edge_point(cell.partner(edge)), at);
    if (found.distance2 < best.distance2) best = found;
  }
  place[u] = from_u + best.point.u * length_u;
  place[v] = from_v + best.point.v * length_v;
}

}  // namespace isobrick::coarse
