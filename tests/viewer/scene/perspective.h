#pragma once

#include <array>
#include <cmath>

#include <isobrick/vec.h>

namespace isobrick::test {

/// The matrix of View for a camera at `eye` that looks at `target`. `fov_y`: radians; near and far:
/// distances. If `up` is parallel to the view another direction is used.
inline std::array<double, 16> perspective_view(Vec3d eye, Vec3d target, Vec3d up, double fov_y,
                                               double aspect, double near, double far) {
  const auto unit = [](Vec3d v) { return v * (1 / std::sqrt(dot(v, v))); };
  const Vec3d ahead = unit(target - eye);
  Vec3d across = cross(ahead, up);
  if (dot(across, across) < 1e-12 * dot(up, up))
    across = cross(ahead, std::abs(ahead.x) < 0.7 ? Vec3d{1, 0, 0} : Vec3d{0, 1, 0});
  const Vec3d right = unit(across);
  const Vec3d above = cross(right, ahead);
  const double f = 1 / std::tan(fov_y / 2);
  const Vec3d rows[4] = {right * (f / aspect), above * f, ahead * ((far + near) / (far - near)),
                         ahead};
  const double last[4] = {0, 0, -2 * far * near / (far - near), 0};
  std::array<double, 16> m{};
  for (std::size_t row = 0; row < 4; ++row) {
    for (std::size_t column = 0; column < 3; ++column)
      m[4 * column + row] = rows[row][static_cast<int>(column)];
    m[12 + row] = last[row] - dot(rows[row], eye);
  }
  return m;
}

}  // namespace isobrick::test
