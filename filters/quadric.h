#pragma once

#include "core/vectors.h"

namespace isobrick::inline v0 {

/// The sum of the squared distances from a point to planes, each with a weight: Garland & Heckbert,
/// Surface simplification using quadric error metrics, 1997.
struct Quadric {
  double xx = 0, xy = 0, xz = 0, yy = 0, yz = 0, zz = 0;
  double x = 0, y = 0, z = 0;
  double constant = 0;

  /// Of the plane through a point; the normal has length 1.
  static Quadric of_plane(Vec3d normal, Vec3d point, double weight) {
    const double d = -dot(normal, point);
    const Vec3d n = normal * weight;
    return {.xx = n.x * normal.x,
            .xy = n.x * normal.y,
            .xz = n.x * normal.z,
            .yy = n.y * normal.y,
            .yz = n.y * normal.z,
            .zz = n.z * normal.z,
            .x = n.x * d,
            .y = n.y * d,
            .z = n.z * d,
            .constant = weight * d * d};
  }

  Quadric& operator+=(const Quadric& q) {
    xx += q.xx, xy += q.xy, xz += q.xz, yy += q.yy, yz += q.yz, zz += q.zz;
    x += q.x, y += q.y, z += q.z, constant += q.constant;
    return *this;
  }

  double at(Vec3d p) const {
    const double of_x = xx * p.x + 2 * (xy * p.y + xz * p.z + x);
    const double of_y = yy * p.y + 2 * (yz * p.z + y);
    return p.x * of_x + p.y * of_y + p.z * (zz * p.z + 2 * z) + constant;
  }
};

}  // namespace isobrick
