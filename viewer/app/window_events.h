#pragma once

#include <vector>

#include "viewer/app/viewer_window.h"

namespace isobrick::inline v0 {

/// Applies mouse, keys and dropped files to a window.
class ViewerWindow::Events {
 public:
  /// Sets the window's callbacks, for its lifetime.
  explicit Events(ViewerWindow& owner);

  /// Called around a frame of Dear ImGui, which otherwise misses a key that was pressed and
  /// released between two frames.
  void hold_tapped_keys();
  void release_tapped_keys();
  /// GLFW time of the last motion of the camera or a slider.
  double last_motion() const { return last_motion_; }
  /// Reports such a motion.
  void moved();

 private:
  void on_button(int button, int action, int mods);
  void on_pointer(double x, double y);
  void on_wheel(double steps);
  void on_key(int key, int action, int mods);
  void tap(int key);
  void on_press(int key, int mods, bool again);
  void move_isovalue(double steps);
  void next_mode();
  FlyKeys fly_keys() const;

  ViewerWindow& owner_;
  int button_ = -1, mods_ = 0;  ///< of the present drag; −1: none
  bool dragged_ = false;        ///< farther than a click
  double x_ = 0, y_ = 0;        ///< of the pointer; of the press until the drag begins
  double time_ = 0;
  double last_motion_ = -1e9;
  std::vector<int> tapped_;  ///< keys that went down since the last frame
};

}  // namespace isobrick
