#pragma once

#include <cmath>
#include <limits>
#include <type_traits>

#include <isobrick/vec.h>
#include "core/host_device.h"

// The arithmetic of a vertex, shared verbatim by both backends. Every operation
// is one IEEE operation in the order written; the build forbids contraction.

namespace isobrick::inline v0 {

/// The type in which samples of type T are interpolated: float holds every
/// 8- and 16-bit integer, 32-bit integers need double.
template <class T>
using Real = std::conditional_t<(sizeof(T) <= 2 || std::is_same_v<T, float>), float, double>;

/// Where on an edge with samples a and b, on different sides, the isovalue
/// lies: 0 at a, 1 at b. Defined for infinite samples and for differences that
/// overflow, too.
template <class R>
ISOBRICK_HD inline R edge_parameter(R a, R b, R iso) {
  const R d = b - a;
  if (d >= -std::numeric_limits<R>::max() && d <= std::numeric_limits<R>::max())
    return (iso - a) / d;
  const R inf = std::numeric_limits<R>::infinity();
  const bool a_inf = a == inf || a == -inf, b_inf = b == inf || b == -inf;
  if (a_inf && b_inf) return R(0.5);
  if (a_inf) return R(1);
  if (b_inf) return iso == b ? R(1) : R(0);
  return (iso * R(0.5) - a * R(0.5)) / (b * R(0.5) - a * R(0.5));
}

/// Index space to world space, in float: rows of direction · spacing, and origin.
struct WorldMap {
  float m[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  float origin[3] = {0, 0, 0};
  /// Of gradients: direction · spacing⁻¹, negated where smaller samples are inside.
  float normal[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  /// Triangles turn round: either the axes are left-handed or smaller samples are inside.
  bool mirrored = false;

  ISOBRICK_HD Vec3f position(Vec3f p) const {
    return {origin[0] + (m[0] * p.x + (m[1] * p.y + m[2] * p.z)),
            origin[1] + (m[3] * p.x + (m[4] * p.y + m[5] * p.z)),
            origin[2] + (m[6] * p.x + (m[7] * p.y + m[8] * p.z))};
  }

  /// Unit normal towards the outside from an index-space gradient; where
  /// the gradient vanishes or is no number, from `fallback` instead.
  ISOBRICK_HD Vec3f unit_normal(Vec3f gradient, Vec3f fallback) const {
    Vec3f n = turn(gradient);
    float length2 = n.x * n.x + (n.y * n.y + n.z * n.z);
    // Beyond these bounds the squares lost their precision; scale first.
    if (!(length2 >= 1e-30f && length2 <= 1e30f)) {
      const float size = largest(n);
      const bool usable = size > 0.0f && size <= std::numeric_limits<float>::max();
      n = usable ? n : turn(fallback);
      const float scale = usable ? size : largest(n);
      n = {n.x / scale, n.y / scale, n.z / scale};
      length2 = n.x * n.x + (n.y * n.y + n.z * n.z);
    }
    const float length = std::sqrt(length2);
    return {-n.x / length, -n.y / length, -n.z / length};
  }

 private:
  ISOBRICK_HD Vec3f turn(Vec3f g) const {
    return {normal[0] * g.x + (normal[1] * g.y + normal[2] * g.z),
            normal[3] * g.x + (normal[4] * g.y + normal[5] * g.z),
            normal[6] * g.x + (normal[7] * g.y + normal[8] * g.z)};
  }
  /// Not a number when a component is.
  ISOBRICK_HD static float largest(Vec3f v) {
    const float x = v.x < 0 ? -v.x : v.x, y = v.y < 0 ? -v.y : v.y, z = v.z < 0 ? -v.z : v.z;
    const float xy = x < y ? y : x;
    const float all = xy < z ? z : xy;
    return x + y + z >= 0 ? all : std::numeric_limits<float>::quiet_NaN();
  }
};

}  // namespace isobrick
