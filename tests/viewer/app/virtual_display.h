#pragma once

#include <memory>
#include <string>

struct GLFWwindow;

namespace isobrick::inline v0 {

/// A display without a screen (Xvfb), with simulated input (the XTEST extension). DISPLAY names it
/// while it lives.
class VirtualDisplay {
 public:
  /// Throws std::runtime_error when Xvfb does not start.
  VirtualDisplay(int width, int height, int dots_per_inch = 96);
  ~VirtualDisplay();
  VirtualDisplay(const VirtualDisplay&) = delete;
  VirtualDisplay& operator=(const VirtualDisplay&) = delete;

  /// Whether there is an Xvfb program.
  static bool available();

  /// Minimises a window, and restores it, as a window manager does.
  void minimise(GLFWwindow* window);
  void restore(GLFWwindow* window);

  /// Sends keys to the window under the pointer, as there is no window manager.
  void focus_under_pointer();
  /// The colour that the display shows at a pixel of a window: 0xRRGGBB.
  unsigned long pixel(GLFWwindow* window, int x, int y);
  void move_pointer(int x, int y);
  void button(int number, bool down);  ///< 1 left, 2 middle, 3 right, 4 and 5 the wheel
  void key(unsigned long keysym, bool down);
  void tap(unsigned long keysym) {
    key(keysym, true);
    key(keysym, false);
  }

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace isobrick
