#pragma once

#include <cmath>
#include <cstdint>
#include <limits>

#include "core/host_device.h"
#include "surface/case_rule.h"

// How the trilinear interpolant passes through one cell: decisions that both backends can share
// verbatim. Every operation is one IEEE operation in the order written. docs/design/surface.md
// has the reasons.
//
// Ties. Everything is decided as if the isovalue were less by an infinitely small amount. So a
// sample that equals the isovalue is inside, and the inside of a face is connected where its
// saddle point equals the isovalue.

namespace isobrick::inline v0 {

/// The surface within a cell. Corners of triangles are edges of the cell, 0 … 11, or inner
/// vertices, from kFirstInner on. Those of a tunnel come first, then the loops' centres.
struct CellPatch {
  std::uint16_t first = 0;  ///< of TopologyTables::corners
  std::uint8_t triangles = 0;
  std::uint8_t inner = 0;        ///< vertices that lie in the cell
  std::int8_t diagonal = -1;     ///< of the tunnel, see Necklace; −1: the patch has none
  std::uint16_t centre[2] = {};  ///< edges of the loops with an inner vertex, as bits
};

inline constexpr int kFirstInner = 12;
inline constexpr int kMaxPatchInner = 3;
inline constexpr int kMaxPatchTriangles = 16;

/// A case whose ambiguous faces are decided.
struct FaceConfiguration {
  std::uint16_t patch = 0;  ///< where every loop bounds a disc
  /// The first of four patches, one for each diagonal, where has_tunnel(d, n) can be true for
  /// tunnel n = 0 … 3; 0: it cannot.
  std::uint16_t tunnel[4] = {};
};

/// Where the configurations of a case begin, one for each choice of its ambiguous faces.
struct CaseConfigurations {
  std::uint16_t first = 0;             ///< of the configurations
  std::uint16_t consistent_patch = 0;  ///< which the case tables have
  std::uint8_t faces = 0;              ///< how many are ambiguous
  std::uint8_t corners[6][4] = {};     ///< of these faces, in order around them
  bool needs_values = false;           ///< the corners' sides do not decide the patch alone
};

/// Every way that a surface can take through a cell. Patch 0 is empty.
struct TopologyTables {
  static constexpr int kMaxConfigurations = 1024, kMaxPatches = 1536, kMaxCorners = 49152;
  CaseConfigurations cases[256];
  FaceConfiguration configurations[kMaxConfigurations];
  CellPatch patches[kMaxPatches];
  std::uint8_t corners[kMaxCorners];
};

namespace cell_topology {

/// Sample − isovalue, finite: infinite differences count as the largest finite ones.
ISOBRICK_HD inline double above_isovalue(double sample, double isovalue) {
  constexpr double most = std::numeric_limits<double>::max();
  if (sample == isovalue) return 0;  // also where both are infinite
  const double d = sample - isovalue;
  return d > most ? most : d < -most ? -most : d;
}

/// A power of two that makes products of four such values neither overflow nor vanish.
template <int n>
ISOBRICK_HD inline double scale_of(const double (&d)[n]) {
  double size = 0;
  for (const double v : d) size = std::fabs(v) > size ? std::fabs(v) : size;
  if (size == 0 || (size > 1e-60 && size < 1e60)) return 1;
  // In two steps, because the smallest numbers have no reciprocal.
  const int exponent = std::ilogb(size);
  return std::ldexp(1.0, exponent < -1000 ? 1000 : -exponent);
}

/// The sign of a·b − c·d, exactly while no product overflows or loses bits to underflow.
ISOBRICK_HD inline int compare_products(double a, double b, double c, double d) {
  const double ab = a * b, cd = c * d;
  if (ab != cd) return ab < cd ? -1 : 1;
  const double e = std::fma(a, b, -ab), f = std::fma(c, d, -cd);
  return e < f ? -1 : e > f ? 1 : 0;
}

/// The asymptotic decider: whether the inside of an ambiguous face with these corners, in order
/// around it, stays in one piece. Both cells at the face get the same answer.
ISOBRICK_HD inline bool joins_inside(double a, double b, double c, double d) {
  // Rounding keeps the order of products that differ, and in this range none is lost.
  const double ac = a * c, bd = b * d, larger = ac > bd ? ac : bd;
  if (ac != bd && larger > 1e-250 && larger < 1e300) return (ac > bd) == (a >= 0);
  const double corners[4] = {a, b, c, d};
  const double s = scale_of(corners);
  const int sign = compare_products(a * s, c * s, b * s, d * s);
  return a >= 0 ? sign >= 0 : sign <= 0;
}

// Tunnels. In the plane at w = 0 … 1 along z the interpolant is bilinear. Take the planes in which
// two opposite corners are inside and the other two outside: an interval of w. There the sign of
// q(w), the product of the corners inside less that of those outside, says which pair is
// connected. q is a quadratic polynomial. A tunnel exists where q has one sign at both ends of the
// interval and the other one between them. The signs at the ends follow from the case and its faces
// (topology_tables.cpp); what is left are the signs of the discriminant and of q′ at the ends.

/// Tunnel n of a cell: bit 0 is set when it joins the outside through the inside, bit 1 when the
/// columns of corners 1 and 2, instead of 0 and 3, are the pair inside. Assumes that q has the
/// sign of a tunnel at the ends.
ISOBRICK_HD inline bool has_tunnel(const double (&d)[8], int n) {
  const bool joins_outside = (n & 1) != 0;
  const int i = n & 2 ? 1 : 0, j = 3 - i, k = 1 - i, l = 2 + i;
  // q(w) = q0 (1 − w)² + m w (1 − w) + q1 w²
  const double q0 = d[i] * d[j] - d[k] * d[l];
  const double q1 = d[i + 4] * d[j + 4] - d[k + 4] * d[l + 4];
  const double m = (d[i] * d[j + 4] + d[i + 4] * d[j]) - (d[k] * d[l + 4] + d[k + 4] * d[l]);
  const int discriminant = compare_products(m, m, 4 * q0, q1);
  if (joins_outside ? discriminant <= 0 : discriminant < 0) return false;
  // q′ at w = 0 and w = 1, times the sign of q at the ends: linear in between.
  const double sign = joins_outside ? 1 : -1;
  const double g0 = sign * (m - 2 * q0), g1 = sign * (2 * q1 - m);
  if (!(g0 < 0 && g1 > 0)) return false;
  for (int side = 0; side < 2; ++side) {
    const int c = joins_outside ? (side ? l : k) : (side ? j : i);
    const double low = d[c], high = d[c + 4];
    if ((low >= 0) == (high >= 0)) continue;
    // The interval begins or ends where the column passes the isovalue.
    const double g = g0 * std::fabs(high) + g1 * std::fabs(low);
    if ((low >= 0) == joins_outside ? !(g < 0) : !(g > 0)) return false;
  }
  return true;
}

/// The neck of a tunnel. Six straight lines of the surface, along the axes, form a closed hexagon
/// around it. Its vertices are corners of the box low … high, all but `diagonal` and the corner
/// opposite to it.
struct Necklace {
  double low[3], high[3];
  int diagonal;  ///< 0 … 3: at the low end along z
};

/// The roots of q0 (1 − w)² + m w (1 − w) + q1 w² in a cell, kept apart and off its faces.
ISOBRICK_HD inline void roots_within(double q0, double m, double q1, double& low, double& high) {
  constexpr double margin = 1.0 / 256, gap = 1.0 / 64;
  const double discriminant = m * m - 4 * q0 * q1;
  const double root = discriminant > 0 ? std::sqrt(discriminant) : 0;
  const double t = -0.5 * (m < 0 ? m - root : m + root);
  double a = t / (t + q1), b = q0 / (q0 + t);
  if (!(a > margin)) a = margin;
  if (!(a < 1 - margin)) a = 1 - margin;
  if (!(b > margin)) b = margin;
  if (!(b < 1 - margin)) b = 1 - margin;
  low = a < b ? a : b;
  high = a < b ? b : a;
  if (high - low < gap) {
    const double middle = 0.5 * (low + high);
    low = middle - 0.5 * gap;
    high = middle + 0.5 * gap;
    if (low < margin) high += margin - low, low = margin;
    if (high > 1 - margin) low -= high - (1 - margin), high = 1 - margin;
  }
}

/// The necklace of a cell with a tunnel.
ISOBRICK_HD inline Necklace necklace(const double (&d)[8]) {
  Necklace neck{};
  for (int axis = 0; axis < 3; ++axis) {
    const int w = 1 << axis, u = axis == 0 ? 2 : 1, v = axis == 2 ? 2 : 4;
    const double q0 = d[0] * d[u + v] - d[u] * d[v];
    const double q1 = d[w] * d[w + u + v] - d[w + u] * d[w + v];
    const double m = (d[0] * d[w + u + v] + d[w] * d[u + v]) - (d[u] * d[w + v] + d[w + u] * d[v]);
    roots_within(q0, m, q1, neck.low[axis], neck.high[axis]);
  }
  // In the plane at the low end along z lie two of the lines, at one end along x and along y each.
  const double w = neck.low[2];
  double p[4];
  for (int c = 0; c < 4; ++c) p[c] = d[c] * (1 - w) + d[c + 4] * w;
  for (int axis = 0; axis < 2; ++axis) {
    const int across = axis == 0 ? 1 : 2, along = 3 - across;
    const double near = p[0] - p[across], far = p[along] - p[along + across];
    const bool take_near = std::fabs(near) > std::fabs(far);
    const double at = take_near ? p[0] / near : p[along] / far;
    const bool at_high = std::fabs(at - neck.high[axis]) < std::fabs(at - neck.low[axis]);
    if (!at_high) neck.diagonal |= across;  // the diagonal lies at the other end
  }
  return neck;
}

/// The number of a cell's patch, from its case and its corners less the isovalue.
ISOBRICK_HD inline int patch_of(const TopologyTables& tables, int index, const double (&d)[8]) {
  const CaseConfigurations& of_case = tables.cases[index];
  int configuration = of_case.first;
  for (int f = 0; f < of_case.faces; ++f) {
    const std::uint8_t(&c)[4] = of_case.corners[f];
    configuration += static_cast<int>(joins_inside(d[c[0]], d[c[1]], d[c[2]], d[c[3]])) << f;
  }
  const FaceConfiguration& decided = tables.configurations[configuration];
  if (!(decided.tunnel[0] | decided.tunnel[1] | decided.tunnel[2] | decided.tunnel[3]))
    return decided.patch;
  double scaled[8];
  const double s = scale_of(d);
  for (int c = 0; c < 8; ++c) scaled[c] = d[c] * s;
  for (int n = 0; n < 4; ++n)
    if (decided.tunnel[n] && has_tunnel(scaled, n))
      return decided.tunnel[n] + necklace(scaled).diagonal;
  return decided.patch;
}

}  // namespace cell_topology
}  // namespace isobrick
