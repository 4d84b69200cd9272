#pragma once

#include <array>
#include <glm/mat3x3.hpp>
#include <glm/mat4x4.hpp>

#include <isobrick/vec.h>

namespace isobrick {

/// A ball in world space.
struct WorldBall {
  Vec3d centre;
  double radius = 1;
  friend bool operator==(const WorldBall&, const WorldBall&) = default;
};

/// The smallest ball around a box; of radius 1 if the box is a point or not finite.
WorldBall ball_around(Vec3d lo, Vec3d hi);

/// The half line from `origin` along the unit vector `direction`.
struct WorldRay {
  Vec3d origin, direction;
};

/// Where pictures are taken from, in world space. Camera space: x to the right, y
/// up, z towards the eye, origin at the eye; it keeps world lengths.
class Camera {
 public:
  /// Looks from `eye` to `target`. `up`: world direction that shows upwards;
  /// another is taken where it is along the view.
  Camera(Vec3d eye, Vec3d target, Vec3d up);
  Camera() : Camera({0, -1, 0}, {0, 0, 0}, {0, 0, 1}) {}

  Vec3d eye, target;
  /// Unit vectors of camera space in the world.
  Vec3d right, up, back;
  /// Across the shorter side of the picture, degrees, 1 … 170.
  double field_of_view = 30;
  /// Parallel rays: the picture shows what perspective shows at the target.
  bool orthographic = false;
  /// Everything that is drawn: where depth begins (and ends, if orthographic).
  WorldBall scene{{0, 0, 0}, 1};

  double distance() const;

  // Moves for a mouse. Angles in radians.

  /// Turns around the target: `around` the axis `axis` of the world (to the left), then
  /// `over` the camera's own horizontal one (upwards). Without end: over the poles, too.
  void orbit(double around, double over, Vec3d axis);
  /// Turns the picture about the line of sight.
  void roll(double angle);
  /// Shifts eye and target by parts of the picture's shorter side.
  void pan(double to_right, double to_top);
  /// Divides the distance from the target.
  void zoom(double factor);
  /// Moves the eye so that the box fills a picture of width / height `aspect` but for a
  /// margin, seen from the same direction; looks at its centre. Sets `scene` too.
  void fit(Vec3d lo, Vec3d hi, double aspect);

  /// World directions into camera space.
  glm::dmat3 rotation() const;
  /// Camera space to clip space with depth 1 near and 0 far (GL_ZERO_TO_ONE).
  /// `aspect`: width / height.
  glm::dmat4 projection(double aspect) const;
  /// Nearest and farthest depth; perspective has no end.
  double near_depth() const;
  double far_depth() const;
  /// World length of the picture's shorter side at a depth.
  double extent_at(double depth) const;

  /// Through a point of a picture of width × height pixels; rows from the top,
  /// pixel centres at .5.
  WorldRay ray(double x, double y, int width, int height) const;
  /// The picture's point of a world position; the third is its depth (in front of
  /// the eye: > 0), world units.
  Vec3d project(Vec3d world, int width, int height) const;

  friend bool operator==(const Camera&, const Camera&) = default;
};

}  // namespace isobrick
