#pragma once

#include <array>
#include <string>

#include <isobrick/vec.h>

namespace isobrick::inline v0 {

/// From index space to world space:
/// world = origin + direction · (spacing ∘ index).
/// `direction` is row-major; its columns are the world directions of the index
/// axes x, y, z and are orthonormal up to rounding.
struct Transform {
  Vec3d spacing{1, 1, 1};  ///< world units between samples along each index axis
  Vec3d origin{0, 0, 0};   ///< the place of sample (0, 0, 0) in world space
  std::array<double, 9> direction{1, 0, 0, 0, 1, 0, 0, 0, 1};  ///< rows of the rotation
  std::string unit;  ///< of the world coordinates, as OME-Zarr writes it ("micrometer"), or empty

  friend bool operator==(const Transform&, const Transform&) = default;

  /// Whether index and world axes agree.
  bool axis_aligned() const {
    return direction == std::array<double, 9>{1, 0, 0, 0, 1, 0, 0, 0, 1};
  }

  /// From a sample to the next one along an index axis, in world space.
  Vec3d step(int axis) const {
    const auto column = static_cast<std::size_t>(axis);
    return Vec3d{direction[column], direction[column + 3], direction[column + 6]} * spacing[axis];
  }

  /// From world space to index space.
  Vec3d index_of(Vec3d p) const {
    Vec3d index;
    for (int axis = 0; axis < 3; ++axis) {
      const Vec3d s = step(axis);
      index[axis] = dot(p - origin, s) / dot(s, s);
    }
    return index;
  }

  /// From index space to world space.
  Vec3d apply(Vec3d p) const {
    const Vec3d s = spacing * p;
    return {origin.x + direction[0] * s.x + direction[1] * s.y + direction[2] * s.z,
            origin.y + direction[3] * s.x + direction[4] * s.y + direction[5] * s.z,
            origin.z + direction[6] * s.x + direction[7] * s.y + direction[8] * s.z};
  }
};

}  // namespace isobrick
