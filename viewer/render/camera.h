#pragma once

#include <array>
#include <glm/mat3x3.hpp>
#include <glm/mat4x4.hpp>

#include <isobrick/vec.h>

namespace isobrick::inline v0 {

/// A ball in world space.
struct WorldBall {
  Vec3d centre;
  double radius = 1;
  friend bool operator==(const WorldBall&, const WorldBall&) = default;
};

/// The smallest ball around a box; its radius is 1 if the box is a point or not finite.
WorldBall ball_around(Vec3d lo, Vec3d hi);

/// Rotates `v` about the unit vector `axis` (Rodrigues).
Vec3d rotated(Vec3d v, Vec3d axis, double angle);

/// The half line from `origin` along the unit vector `direction`.
struct WorldRay {
  Vec3d origin, direction;
};

/// The camera of a picture, in world space. Camera space: x to the right, y up, z towards the eye,
/// origin at the eye, world units.
class Camera {
 public:
  /// Looks from `eye` to `target`. `up`: world direction that is upwards on the picture; another
  /// one is chosen if it is parallel to the view.
  Camera(Vec3d eye, Vec3d target, Vec3d up);
  Camera() : Camera({0, -1, 0}, {0, 0, 0}, {0, 0, 1}) {}

  Vec3d eye, target;
  /// Unit vectors of camera space, in world space.
  Vec3d right, up, back;
  /// Field of view across the picture's shorter side, degrees, 1 … 170.
  double field_of_view = 30;
  /// Parallel projection with the same extent at the target as the perspective one.
  bool orthographic = false;
  /// Bounds of everything that is drawn: they set the near plane (and the far plane of a parallel
  /// projection).
  WorldBall scene{{0, 0, 0}, 1};

  double distance() const;

  // Motions by mouse. Angles in radians.

  /// Rotates around the target: by `around` about the axis `axis` of the world (to the left), then
  /// by `over` about the camera's own horizontal axis (upwards). It does not stop at the poles.
  void orbit(double around, double over, Vec3d axis);
  /// Rotates about the line of sight.
  void roll(double angle);
  /// Shifts eye and target by fractions of the picture's shorter side.
  void pan(double to_right, double to_top);
  /// Divides the distance to the target by `factor`.
  void zoom(double factor);
  /// Moves the eye along the present direction, and the target to the box's centre, so that the box
  /// fills a picture of width / height `aspect` up to a margin. Sets `scene` too.
  void fit(Vec3d lo, Vec3d hi, double aspect);

  /// Rotation from world space to camera space.
  glm::dmat3 rotation() const;
  /// Camera space to clip space, with depth 1 near and 0 far (GL_ZERO_TO_ONE). `aspect`: width /
  /// height.
  glm::dmat4 projection(double aspect) const;
  /// Nearest and farthest depth; a perspective projection has no far plane.
  double near_depth() const;
  double far_depth() const;
  /// World length of the picture's shorter side at a depth.
  double extent_at(double depth) const;

  /// The ray through a point of a picture of width × height pixels; rows from the top, pixel
  /// centres at .5.
  WorldRay ray(double x, double y, int width, int height) const;
  /// The pixel position of a world position; z is its depth in world units, positive in front of
  /// the eye.
  Vec3d project(Vec3d world, int width, int height) const;

  friend bool operator==(const Camera&, const Camera&) = default;
};

}  // namespace isobrick
