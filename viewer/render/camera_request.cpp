#include "viewer/render/camera_request.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <glm/trigonometric.hpp>
#include <string>

#include <isobrick/error.h>
#include "core/vectors.h"

namespace isobrick::inline v0 {
namespace {

constexpr const char* kForm =
    "azimuth=30,elevation=20,roll=0,zoom=1,fov=30,orthographic,up=0:0:1,from=X:Y:Z,eye=X:Y:Z,"
    "target=X:Y:Z";

double number(std::string_view part, std::string_view text) {
  if (text.starts_with('+')) text.remove_prefix(1);
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(value))
    throw UsageError(fmt::format("'{}' in a camera is not a finite number", part));
  return value;
}

double number_in(std::string_view part, std::string_view text, double min, double max) {
  const double value = number(part, text);
  if (value < min || value > max)
    throw UsageError(fmt::format("'{}' in a camera must be {} to {}", part, min, max));
  return value;
}

Vec3d triple(std::string_view part, std::string_view text) {
  const auto first = text.find(':'), second = text.find(':', first + 1);
  if (first == text.npos || second == text.npos)
    throw UsageError(fmt::format("'{}' in a camera is not of the form X:Y:Z", part));
  return {number(part, text.substr(0, first)),
          number(part, text.substr(first + 1, second - first - 1)),
          number(part, text.substr(second + 1))};
}

bool has_direction(Vec3d v) {
  const double size = length(v);
  return size > 0 && std::isfinite(size);
}

Vec3d direction(std::string_view part, std::string_view text) {
  const Vec3d v = triple(part, text);
  if (!has_direction(v)) throw UsageError(fmt::format("'{}' in a camera has no direction", part));
  return v;
}

/// `back`: from the target towards the eye. The default of `up` is replaced if it is parallel to
/// the view.
void check_view(const CameraRequest& request, Vec3d back) {
  if (!has_direction(back))
    throw UsageError("a camera's eye is where its target is; one of them has to be elsewhere");
  if (request.up != CameraRequest().up &&
      length(cross(unit(request.up, {}), unit(back, {}))) < 1e-6)
    throw UsageError("a camera cannot look along its up; give another or leave it out");
}

void take(CameraRequest& request, std::string_view part) {
  if (part == "orthographic") {
    request.orthographic = true;
    return;
  }
  const auto equals = part.find('=');
  const std::string_view key = part.substr(0, equals);
  const std::string_view text = equals == part.npos ? "" : part.substr(equals + 1);
  if (key == "azimuth") {
    request.azimuth = number(part, text);
  } else if (key == "elevation") {
    request.elevation = number_in(part, text, -90, 90);
  } else if (key == "roll") {
    request.roll = number(part, text);
  } else if (key == "zoom") {
    request.zoom = number_in(part, text, 1e-3, 1e6);
  } else if (key == "fov") {
    request.field_of_view = number_in(part, text, 1, 150);
  } else if (key == "up") {
    request.up = direction(part, text);
  } else if (key == "from") {
    request.from = direction(part, text);
  } else if (key == "eye") {
    request.eye = triple(part, text);
  } else if (key == "target") {
    request.target = triple(part, text);
  } else {
    throw UsageError(fmt::format("'{}' is no part of a camera; the form is {}", part, kForm));
  }
}

/// Converts the two angles to the direction towards the eye.
Vec3d direction_of(const CameraRequest& request) {
  const Vec3d up = unit(request.up, {0, 0, 1});
  // With up = z, azimuth 0 is the front, -y. Another `up` rotates the world by the shortest way.
  Vec3d right = cross(up, {0, -1, 0});
  if (length(right) < 1e-6) right = {1, 0, 0};
  right = unit(right, {1, 0, 0});
  const Vec3d front = cross(right, up);
  const double a = glm::radians(request.azimuth), e = glm::radians(request.elevation);
  return (front * std::cos(a) + right * std::sin(a)) * std::cos(e) + up * std::sin(e);
}

}  // namespace

CameraRequest parse_camera(std::string_view text) {
  CameraRequest request;
  for (std::size_t at = 0; at <= text.size();) {
    const std::size_t comma = std::min(text.find(',', at), text.size());
    take(request, text.substr(at, comma - at));
    at = comma + 1;
  }
  if (request.eye && request.from)
    throw UsageError("a camera has an eye or a direction that it looks from, not both");
  if (request.from) check_view(request, *request.from);
  if (request.eye && request.target) check_view(request, *request.eye - *request.target);
  return request;
}

Camera make_camera(const CameraRequest& request, Vec3d lo, Vec3d hi, double aspect) {
  const WorldBall ball = ball_around(lo, hi);
  const Vec3d target = request.target.value_or(ball.centre);
  if (request.eye) check_view(request, *request.eye - target);
  const Vec3d from = unit(request.from.value_or(direction_of(request)), {0, -1, 0});
  Camera camera(request.eye.value_or(target + from * ball.radius), target, request.up);
  camera.field_of_view = request.field_of_view;
  camera.orthographic = request.orthographic;
  camera.scene = ball;
  if (request.eye) {
    const double half = std::tan(glm::radians(request.field_of_view) / 2) / request.zoom;
    camera.field_of_view = std::clamp(glm::degrees(2 * std::atan(half)), 1e-3, 150.0);
  } else {
    camera.fit(lo, hi, aspect);
    if (request.target) {
      camera.eye = camera.eye + (*request.target - camera.target);
      camera.target = *request.target;
    }
    camera.zoom(request.zoom);
  }
  camera.roll(glm::radians(request.roll));
  return camera;
}

}  // namespace isobrick
