#pragma once

#include <cstddef>

#include <isobrick/vec.h>

namespace isobrick::inline v0 {

/// What lies on one side of a plane of world space: dot(normal, p) >= least. The normal
/// points inwards and is of any length but 0.
struct HalfSpace {
  Vec3d normal;
  double least = 0;

  constexpr bool contains(Vec3d p) const { return dot(normal, p) >= least; }
  friend constexpr bool operator==(const HalfSpace&, const HalfSpace&) = default;
};

/// Bounded by the plane through `point` across `normal`.
constexpr HalfSpace half_space_at(Vec3d point, Vec3d normal) {
  return {normal, dot(normal, point)};
}

/// So many may cut what is shown, besides a box.
inline constexpr std::size_t kMaxClipPlanes = 6;

}  // namespace isobrick
