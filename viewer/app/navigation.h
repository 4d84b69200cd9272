#pragma once

#include <cstdint>

#include "viewer/render/camera.h"

namespace isobrick::inline v0 {

enum class NavigationMode : std::uint8_t {
  orbit,      ///< around the target; the vertical stays vertical
  trackball,  ///< around the target, without a vertical
  fly,        ///< the mouse looks around, keys move the eye
};

/// Direction in which keys move the eye; each component is −1, 0 or 1.
struct FlyKeys {
  int right = 0, up = 0, ahead = 0;
  friend bool operator==(const FlyKeys&, const FlyKeys&) = default;
};

/// Turns mouse and key input into motions of a camera, which slow down smoothly after the input
/// ends. Not thread-safe.
class Navigator {
 public:
  Camera camera;
  NavigationMode mode = NavigationMode::orbit;
  /// World direction that orbits keep vertical.
  Vec3d vertical{0, 0, 1};
  /// Scene radii per second.
  double fly_speed = 0.25;

  /// A drag to the right and downwards, in fractions of the picture's shorter side, which took
  /// `seconds`.
  void rotate(double right, double down, double seconds);
  void pan(double right, double down);
  void roll(double angle) { camera.roll(angle); }
  /// Steps of a wheel: positive zooms in; in fly mode it increases the speed.
  void wheel(double steps);
  void press(FlyKeys keys) { keys_ = keys; }
  /// The button was released: the rotation continues and slows down.
  void release() { held_ = false; }
  /// Stops all motion, because something else has moved the camera.
  void stop();

  /// Advances all motions by `seconds`. Returns whether anything moves.
  bool update(double seconds);
  bool is_moving() const;

 private:
  void turn(double right, double down);

  FlyKeys keys_;
  bool held_ = false;
  double spin_right_ = 0, spin_down_ = 0;  ///< fractions of the shorter side per second
  double push_right_ = 0, push_up_ = 0, push_ahead_ = 0;  ///< fractions of the full speed
};

}  // namespace isobrick
