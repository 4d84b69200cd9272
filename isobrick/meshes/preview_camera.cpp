#include "isobrick/meshes/preview_camera.h"

#include <algorithm>
#include <cmath>

namespace isobrick {
namespace {

Vec3d normalized(Vec3d v, Vec3d otherwise) {
  const double length = std::sqrt(dot(v, v));
  return length > 1e-9 && std::isfinite(length) ? v * (1 / length) : otherwise;
}

Vec3f to_float(Vec3d v) {
  return {static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z)};
}

}  // namespace

PreviewCamera::PreviewCamera(Vec3d world_lo, Vec3d world_hi, Vec3d towards_eye, Vec3d up, int width,
                             int height) {
  constexpr double tan_half_view = 0.27;  // 30° across the shorter side
  constexpr double filled = 0.92;         // of the picture

  const Vec3d back = normalized(towards_eye, {0, -1, 0});
  Vec3d right = cross(up, back);
  if (dot(right, right) < 1e-12) right = cross({0, 1, 0}, back);  // looking along `up`
  right = normalized(right, {1, 0, 0});
  const Vec3d down = cross(right, back);

  const Vec3d half = (world_hi - world_lo) * 0.5;
  const double radius = std::sqrt(dot(half, half));
  const double scale = radius > 0 && std::isfinite(radius) ? 1 / radius : 1.0;
  const double shorter = std::min(width, height);
  const double focal = 0.5 * shorter / tan_half_view;

  double distance = 1.1;
  for (int corner = 0; corner < 8; ++corner) {
    const Vec3d sign{corner & 1 ? 1.0 : -1.0, corner & 2 ? 1.0 : -1.0, corner & 4 ? 1.0 : -1.0};
    const Vec3d p = half * sign * scale;
    const double nearer = dot(p, back);
    distance =
        std::max(distance, nearer + std::abs(dot(p, right)) * focal / (filled * 0.5 * width));
    distance =
        std::max(distance, nearer + std::abs(dot(p, down)) * focal / (filled * 0.5 * height));
  }

  centre_ = to_float((world_lo + world_hi) * 0.5);
  right_ = to_float(right);
  down_ = to_float(down);
  ahead_ = to_float(back * -1.0);
  half_ = {0.5f * static_cast<float>(width), 0.5f * static_cast<float>(height), 0};
  scale_ = static_cast<float>(scale);
  distance_ = static_cast<float>(distance);
  focal_ = static_cast<float>(focal);
}

}  // namespace isobrick
