#include "viewer/app/navigation.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace isobrick::inline v0 {
namespace {

/// Angle of a drag across the picture's shorter side.
constexpr double kFullTurn = std::numbers::pi;
constexpr double kSpinSeconds = 0.25;  ///< time in which a spin slows down to 1/e
constexpr double kPushSeconds = 0.12;
constexpr double kStillSpin = 0.01, kStillPush = 0.01;
constexpr double kWheelStep = 1.15;

/// Rotates the camera about its eye.
void look(Camera& camera, double right, double up, Vec3d vertical) {
  const double distance = camera.distance();
  const auto turn = [&](Vec3d axis, double angle) {
    for (Vec3d* v : {&camera.right, &camera.up, &camera.back}) *v = rotated(*v, axis, angle);
  };
  turn(vertical, -right);
  turn(camera.right, up);
  camera.target = camera.eye - camera.back * distance;
}

/// Moves `value` towards `goal`; the difference shrinks to 1/e in `time`.
void approach(double& value, double goal, double seconds, double time) {
  value = goal + (value - goal) * std::exp(-seconds / time);
  if (goal == 0 && std::abs(value) < kStillPush) value = 0;
}

}  // namespace

void Navigator::turn(double right, double down) {
  const double angle = right * kFullTurn, over = down * kFullTurn;
  switch (mode) {
    case NavigationMode::orbit: camera.orbit(angle, over, vertical); break;
    case NavigationMode::trackball: camera.orbit(angle, over, camera.up); break;
    case NavigationMode::fly: {
      // The point under the pointer stays there.
      const double view = camera.field_of_view * std::numbers::pi / 180;
      look(camera, -right * view, down * view, vertical);
      break;
    }
  }
}

void Navigator::rotate(double right, double down, double seconds) {
  turn(right, down);
  // An average of the last few events, since single ones vary.
  const double time = std::max(seconds, 1e-3);
  const double blend = held_ ? std::exp(-time / 0.05) : 0;
  spin_right_ = blend * spin_right_ + (1 - blend) * right / time;
  spin_down_ = blend * spin_down_ + (1 - blend) * down / time;
  held_ = true;
}

void Navigator::pan(double right, double down) {
  stop();
  camera.pan(-right, down);
}

void Navigator::wheel(double steps) {
  const double factor = std::pow(kWheelStep, steps);
  if (mode == NavigationMode::fly)
    fly_speed = std::clamp(fly_speed * factor, 1e-4, 10.0);
  else
    camera.zoom(factor);
}

void Navigator::stop() {
  held_ = false;
  spin_right_ = spin_down_ = push_right_ = push_up_ = push_ahead_ = 0;
}

bool Navigator::is_moving() const {
  return (!held_ && (spin_right_ != 0 || spin_down_ != 0)) || !(keys_ == FlyKeys{}) ||
         push_right_ != 0 || push_up_ != 0 || push_ahead_ != 0;
}

bool Navigator::update(double seconds) {
  if (held_) {
    // Holding the mouse still stops the spin.
    approach(spin_right_, 0, seconds, 0.05);
    approach(spin_down_, 0, seconds, 0.05);
  } else if (spin_right_ != 0 || spin_down_ != 0) {
    turn(spin_right_ * seconds, spin_down_ * seconds);
    const double slower = std::exp(-seconds / kSpinSeconds);
    spin_right_ *= slower;
    spin_down_ *= slower;
    if (std::hypot(spin_right_, spin_down_) < kStillSpin) spin_right_ = spin_down_ = 0;
  }
  approach(push_right_, keys_.right, seconds, kPushSeconds);
  approach(push_up_, keys_.up, seconds, kPushSeconds);
  approach(push_ahead_, keys_.ahead, seconds, kPushSeconds);
  const double way = fly_speed * camera.scene.radius * seconds;
  const Vec3d move =
      (camera.right * push_right_ + camera.up * push_up_ - camera.back * push_ahead_) * way;
  camera.eye = camera.eye + move;
  camera.target = camera.target + move;
  return is_moving();
}

}  // namespace isobrick
