#pragma once

#include <cstdint>

#include "viewer/render/camera.h"

namespace isobrick {

/// How a mouse moves the camera.
enum class NavigationMode : std::uint8_t {
  orbit,      ///< around the target, the vertical stays vertical
  trackball,  ///< around the target, any way up
  fly,        ///< the mouse looks around, keys move the eye
};

/// Which way keys push the eye, each component −1, 0 or 1: to the right, up, ahead.
struct FlyKeys {
  int right = 0, up = 0, ahead = 0;
  friend bool operator==(const FlyKeys&, const FlyKeys&) = default;
};

/// Turns what mouse and keys do into motions of a camera, which run out softly when the
/// hand lets go. Not thread-safe.
class Navigator {
 public:
  Camera camera;
  NavigationMode mode = NavigationMode::orbit;
  /// World direction that orbits keep vertical.
  Vec3d vertical{0, 0, 1};
  /// Scene radii a second.
  double fly_speed = 0.25;

  /// A drag by parts of the picture's shorter side, to the right and downwards, which took
  /// `seconds`.
  void rotate(double right, double down, double seconds);
  void pan(double right, double down);
  void roll(double angle) { camera.roll(angle); }
  /// Steps of a wheel: nearer if positive; in fly mode: faster.
  void wheel(double steps);
  void press(FlyKeys keys) { keys_ = keys; }
  /// The button is up: the rotation goes on by itself and slows down.
  void release() { held_ = false; }
  /// Something else has moved the camera: nothing goes on by itself.
  void stop();

  /// Moves on by `seconds`. True while anything moves.
  bool update(double seconds);
  bool moving() const;

 private:
  void turn(double right, double down);

  FlyKeys keys_;
  bool held_ = false;
  double spin_right_ = 0, spin_down_ = 0;                 ///< parts of the shorter side a second
  double push_right_ = 0, push_up_ = 0, push_ahead_ = 0;  ///< of the full speed
};

}  // namespace isobrick
