#pragma once

#include <algorithm>
#include <array>

#include <isobrick/vec.h>

namespace isobrick::inline v0 {

/// Distances from a triangle, which may be as thin as a line or a point. In float:
/// its corners should be near zero and its edges not far from 1 long.
class TriangleDistance {
 public:
  TriangleDistance(Vec3f a, Vec3f b, Vec3f c) : corners_{a, b, c} {
    const Vec3f n = cross(b - a, c - a);
    const float area2 = dot(n, n);
    flat_ = area2 > kTiny;
    normal_ = n;
    inverse_area2_ = flat_ ? 1 / area2 : 0;
    for (std::size_t k = 0; k < 3; ++k) {
      edges_[k] = corners_[(k + 1) % 3] - corners_[k];
      outward_[k] = cross(edges_[k], n);
      const float length2 = dot(edges_[k], edges_[k]);
      inverse_length2_[k] = length2 > kTiny ? 1 / length2 : 0;
    }
  }

  /// Square of the distance of `p` from the nearest point of the triangle.
  float squared(Vec3f p) const {
    const std::array<Vec3f, 3> from{p - corners_[0], p - corners_[1], p - corners_[2]};
    if (flat_ && dot(outward_[0], from[0]) <= 0 && dot(outward_[1], from[1]) <= 0 &&
        dot(outward_[2], from[2]) <= 0) {
      const float height = dot(normal_, from[0]);
      return height * height * inverse_area2_;
    }
    return std::min({to_edge(from[0], 0), to_edge(from[1], 1), to_edge(from[2], 2)});
  }

 private:
  static constexpr float kTiny = 1e-20F;

  float to_edge(Vec3f from, std::size_t k) const {
    const float along = std::clamp(dot(from, edges_[k]) * inverse_length2_[k], 0.0F, 1.0F);
    const Vec3f rest = from - edges_[k] * along;
    return dot(rest, rest);
  }

  std::array<Vec3f, 3> corners_, edges_, outward_;  ///< in the plane, away from the triangle
  Vec3f normal_;
  std::array<float, 3> inverse_length2_{};
  float inverse_area2_ = 0;
  bool flat_ = false;  ///< has an area
};

}  // namespace isobrick
