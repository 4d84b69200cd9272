#pragma once

#include <cmath>

#include <isobrick/vec.h>

namespace isobrick::inline v0 {

inline double length(Vec3d v) { return std::sqrt(dot(v, v)); }

/// v at unit length, or `otherwise` if it has none.
inline Vec3d unit(Vec3d v, Vec3d otherwise) {
  const double size = length(v);
  return size > 0 && std::isfinite(size) ? v * (1 / size) : otherwise;
}

inline Vec3f to_float(Vec3d v) {
  return {static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z)};
}
inline Vec3d to_double(Vec3f v) { return {v.x, v.y, v.z}; }

}  // namespace isobrick
