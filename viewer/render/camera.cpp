#include "viewer/render/camera.h"

#include <algorithm>
#include <cmath>
#include <glm/trigonometric.hpp>

#include "core/vectors.h"

namespace isobrick::inline v0 {

WorldBall ball_around(Vec3d lo, Vec3d hi) {
  const Vec3d half = (hi - lo) * 0.5;
  const double radius = length(half);
  const Vec3d centre = (lo + hi) * 0.5;
  if (!std::isfinite(length(centre))) return {};
  return {centre, radius > 0 && std::isfinite(radius) ? radius : 1.0};
}

Vec3d rotated(Vec3d v, Vec3d axis, double angle) {
  const double c = std::cos(angle), s = std::sin(angle);
  return v * c + cross(axis, v) * s + axis * (dot(axis, v) * (1 - c));
}

Camera::Camera(Vec3d from, Vec3d to, Vec3d upwards) : eye(from), target(to) {
  back = unit(eye - target, {0, -1, 0});
  right = cross(upwards, back);
  if (length(right) < 1e-6 * length(upwards)) {  // the view is parallel to `up`
    right = cross({0, 1, 0}, back);
    if (length(right) < 1e-6) right = {1, 0, 0};
  }
  right = unit(right, {1, 0, 0});
  up = cross(back, right);
}

double Camera::distance() const { return length(eye - target); }

void Camera::orbit(double around, double over, Vec3d axis) {
  const double away = distance();
  const Vec3d pole = unit(axis, {0, 0, 1});
  // Upside down, left and right are exchanged.
  const double angle = dot(up, pole) < 0 ? -around : around;
  for (Vec3d* v : {&right, &up, &back}) *v = rotated(*v, pole, -angle);
  for (Vec3d* v : {&up, &back}) *v = rotated(*v, right, -over);
  back = unit(back, {0, -1, 0});
  right = unit(cross(up, back), {1, 0, 0});
  up = cross(back, right);
  eye = target + back * away;
}

void Camera::roll(double angle) {
  for (Vec3d* v : {&right, &up}) *v = rotated(*v, back, angle);
}

void Camera::pan(double to_right, double to_top) {
  const double shorter = extent_at(distance());
  const Vec3d move = right * (-to_right * shorter) + up * (-to_top * shorter);
  eye = eye + move;
  target = target + move;
}

void Camera::zoom(double factor) {
  if (factor > 0 && std::isfinite(factor)) eye = target + (eye - target) * (1 / factor);
}

void Camera::fit(Vec3d lo, Vec3d hi, double aspect) {
  constexpr double filled = 0.92;  // fraction of the picture
  scene = ball_around(lo, hi);
  const double tangent = std::tan(glm::radians(field_of_view) / 2) * filled;
  const double across = aspect > 1 ? aspect * tangent : tangent;
  const double above = aspect > 1 ? tangent : tangent / aspect;
  const Vec3d half = (hi - lo) * 0.5;
  double away = 0;
  for (int corner = 0; corner < 8; ++corner) {
    const Vec3d p =
        half * Vec3d{corner & 1 ? 1.0 : -1.0, corner & 2 ? 1.0 : -1.0, corner & 4 ? 1.0 : -1.0};
    const double nearer = orthographic ? 0 : dot(p, back);
    away = std::max(
        {away, nearer + std::abs(dot(p, right)) / across, nearer + std::abs(dot(p, up)) / above});
  }
  if (!(away > 0) || !std::isfinite(away)) away = scene.radius / tangent;
  target = scene.centre;
  eye = target + back * away;
}

glm::dmat3 Camera::rotation() const {
  glm::dmat3 m;  // columns
  for (int axis = 0; axis < 3; ++axis) m[axis] = {right[axis], up[axis], back[axis]};
  return m;
}

double Camera::extent_at(double depth) const {
  return 2 * std::tan(glm::radians(field_of_view) / 2) * (orthographic ? distance() : depth);
}

double Camera::near_depth() const {
  const double centre = dot(eye - scene.centre, back);
  if (orthographic) return centre - 1.01 * scene.radius;
  // If the eye is inside the scene, the near plane stays a small distance in front of it.
  return std::max({0.99 * (centre - scene.radius), 1e-4 * scene.radius, 1e-9 * length(eye)});
}

double Camera::far_depth() const {
  return std::max(dot(eye - scene.centre, back) + 1.01 * scene.radius,
                  near_depth() + 1e-3 * scene.radius);
}

glm::dmat4 Camera::projection(double aspect) const {
  const double tangent = std::tan(glm::radians(field_of_view) / 2);
  const double half = orthographic ? tangent * distance() : tangent;
  const double x = aspect > 1 ? aspect * half : half, y = aspect > 1 ? half : half / aspect;
  glm::dmat4 m(0);  // m[column][row]
  m[0][0] = 1 / x;
  m[1][1] = 1 / y;
  const double near = near_depth();
  if (orthographic) {
    const double far = far_depth();
    m[2][2] = 1 / (far - near);
    m[3][2] = far / (far - near);
    m[3][3] = 1;
  } else {
    m[2][3] = -1;
    m[3][2] = near;
  }
  return m;
}

WorldRay Camera::ray(double x, double y, int width, int height) const {
  const double shorter = std::min(width, height);
  const double pixel = 2 * std::tan(glm::radians(field_of_view) / 2) / shorter;
  const double across = (x - 0.5 * width) * pixel, above = (0.5 * height - y) * pixel;
  if (orthographic)
    return {eye + right * (across * distance()) + up * (above * distance()), back * -1.0};
  return {eye, unit(right * across + up * above - back, back * -1.0)};
}

Vec3d Camera::project(Vec3d world, int width, int height) const {
  const Vec3d p = world - eye;
  const double depth = -dot(p, back);
  const double pixel = extent_at(depth) / std::min(width, height);
  return {0.5 * width + dot(p, right) / pixel, 0.5 * height - dot(p, up) / pixel, depth};
}

}  // namespace isobrick
