#include "viewer/app/window_events.h"

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>
#include <imgui.h>

#include <algorithm>
#include <cmath>

namespace isobrick::inline v0 {
namespace {

/// Pixels between press and release, above which they are a drag and not a click.
constexpr double kClickPixels = 4;
constexpr double kIsovalueSteps = 200;  ///< from the lowest sample to the highest

template <class F>
void with_window(GLFWwindow* window, F&& f) {
  f(*static_cast<ViewerWindow*>(glfwGetWindowUserPointer(window)));
}

}  // namespace

ViewerWindow::Events::Events(ViewerWindow& owner) : owner_(owner) {
  GLFWwindow* window = owner.window_;
  glfwSetWindowUserPointer(window, &owner);
  glfwSetMouseButtonCallback(window, [](GLFWwindow* w, int button, int action, int mods) {
    with_window(w, [&](ViewerWindow& v) { v.events_->on_button(button, action, mods); });
  });
  glfwSetCursorPosCallback(window, [](GLFWwindow* w, double x, double y) {
    with_window(w, [&](ViewerWindow& v) { v.events_->on_pointer(x, y); });
  });
  glfwSetScrollCallback(window, [](GLFWwindow* w, double, double steps) {
    with_window(w, [&](ViewerWindow& v) { v.events_->on_wheel(steps); });
  });
  glfwSetKeyCallback(window, [](GLFWwindow* w, int key, int, int action, int mods) {
    with_window(w, [&](ViewerWindow& v) { v.events_->on_key(key, action, mods); });
  });
  // The key of "?" depends on the keyboard.
  glfwSetCharCallback(window, [](GLFWwindow* w, unsigned character) {
    with_window(w, [&](ViewerWindow& v) {
      v.has_event_ = true;
      if (character == '?' && !ImGui::GetIO().WantTextInput) v.state_.help = !v.state_.help;
    });
  });
  glfwSetDropCallback(window, [](GLFWwindow* w, int count, const char** paths) {
    with_window(w, [&](ViewerWindow& v) {
      if (count > 0) v.drop(paths[0]);
      if (count > 1) v.state_.show_message("one file at a time: the first is opened");
    });
  });
  glfwSetFramebufferSizeCallback(window, [](GLFWwindow* w, int, int) {
    with_window(w, [](ViewerWindow& v) { v.has_event_ = true; });
  });
  glfwSetWindowRefreshCallback(
      window, [](GLFWwindow* w) { with_window(w, [](ViewerWindow& v) { v.has_event_ = true; }); });
}

void ViewerWindow::Events::on_button(int button, int action, int mods) {
  owner_.has_event_ = true;
  if (action == GLFW_PRESS) {
    if (button_ >= 0 || ImGui::GetIO().WantCaptureMouse) return;
    button_ = button;
    mods_ = mods;
    glfwGetCursorPos(owner_.window_, &x_, &y_);
    dragged_ = false;
    time_ = glfwGetTime();
    owner_.state_.navigator.stop();
  } else if (button == button_) {
    button_ = -1;
    owner_.state_.navigator.release();
    if (dragged_ || button != GLFW_MOUSE_BUTTON_LEFT) return;
    int width = 1, height = 1;
    glfwGetWindowSize(owner_.window_, &width, &height);
    owner_.click(x_ / std::max(width, 1), y_ / std::max(height, 1));
  }
}

void ViewerWindow::Events::on_pointer(double x, double y) {
  owner_.has_event_ = true;
  if (button_ >= 0) {
    // A click changes neither the camera nor the still frame.
    dragged_ |= std::hypot(x - x_, y - y_) >= kClickPixels;
    if (!dragged_) return;
    int width = 1, height = 1;
    glfwGetWindowSize(owner_.window_, &width, &height);
    const double side = std::max(1, std::min(width, height));
    const double right = (x - x_) / side, down = (y - y_) / side, now = glfwGetTime();
    Navigator& navigator = owner_.state_.navigator;
    const bool shift = (mods_ & GLFW_MOD_SHIFT) != 0, control = (mods_ & GLFW_MOD_CONTROL) != 0;
    if (button_ == GLFW_MOUSE_BUTTON_MIDDLE || (button_ == GLFW_MOUSE_BUTTON_LEFT && shift))
      navigator.pan(right, down);
    else if (button_ == GLFW_MOUSE_BUTTON_LEFT && control)
      navigator.roll(right * 3);
    else if (button_ == GLFW_MOUSE_BUTTON_RIGHT)
      navigator.wheel(-down * 20);
    else
      navigator.rotate(right, down, now - time_);
    time_ = last_motion_ = now;
  }
  x_ = x;
  y_ = y;
}

void ViewerWindow::Events::on_wheel(double steps) {
  owner_.has_event_ = true;
  if (ImGui::GetIO().WantCaptureMouse) return;
  owner_.state_.navigator.wheel(steps);
  last_motion_ = glfwGetTime();
}

void ViewerWindow::Events::moved() { last_motion_ = glfwGetTime(); }

FlyKeys ViewerWindow::Events::fly_keys() const {
  const auto down = [&](int key) { return glfwGetKey(owner_.window_, key) == GLFW_PRESS ? 1 : 0; };
  return {down(GLFW_KEY_D) - down(GLFW_KEY_A), down(GLFW_KEY_E) - down(GLFW_KEY_Q),
          down(GLFW_KEY_W) - down(GLFW_KEY_S)};
}

#if IMGUI_VERSION_NUM < 18700
void ViewerWindow::Events::hold_tapped_keys() {
  for (const int key : tapped_) ImGui::GetIO().KeysDown[key] = true;
}

void ViewerWindow::Events::release_tapped_keys() {
  for (const int key : tapped_)
    ImGui::GetIO().KeysDown[key] = glfwGetKey(owner_.window_, key) == GLFW_PRESS;
  tapped_.clear();
}

void ViewerWindow::Events::tap(int key) {
  if (key >= 0 && key < IM_ARRAYSIZE(ImGuiIO::KeysDown)) tapped_.push_back(key);
}
#else  // ImGui queues events itself, so that the shortest press lasts a frame.
void ViewerWindow::Events::hold_tapped_keys() {}
void ViewerWindow::Events::release_tapped_keys() {}
void ViewerWindow::Events::tap(int) {}
#endif

void ViewerWindow::Events::on_key(int key, int action, int mods) {
  owner_.has_event_ = true;
  if (action == GLFW_PRESS) tap(key);
  const bool typing = ImGui::GetIO().WantTextInput;
  Navigator& navigator = owner_.state_.navigator;
  navigator.press(!typing && navigator.mode == NavigationMode::fly ? fly_keys() : FlyKeys{});
  if (!typing && action != GLFW_RELEASE) on_press(key, mods, action == GLFW_REPEAT);
}

void ViewerWindow::Events::move_isovalue(double steps) {
  ViewerState& state = owner_.state_;
  if (state.isovalue_stats == nullptr || state.settings.surfaces.empty()) return;
  const auto range = state.isovalue_stats->counts().range();
  if (range.empty()) return;
  double& isovalue = state.settings.surfaces[state.selected].isovalue;
  isovalue =
      std::clamp(isovalue + steps * (range.hi - range.lo) / kIsovalueSteps, range.lo, range.hi);
  last_motion_ = glfwGetTime();
}

void ViewerWindow::Events::next_mode() {
  NavigationMode& mode = owner_.state_.navigator.mode;
  mode = static_cast<NavigationMode>((static_cast<int>(mode) + 1) % 3);
}

void ViewerWindow::Events::on_press(int key, int mods, bool again) {
  ViewerState& state = owner_.state_;
  const bool fine = (mods & GLFW_MOD_SHIFT) != 0;
  const bool flying = state.navigator.mode == NavigationMode::fly;
  const auto look = [&](Vec3d along) { state.requests.look_along = fine ? along * -1.0 : along; };
  switch (key) {
    case GLFW_KEY_RIGHT_BRACKET:
    case GLFW_KEY_UP: return move_isovalue(fine ? 0.1 : 1);
    case GLFW_KEY_LEFT_BRACKET:
    case GLFW_KEY_DOWN: return move_isovalue(fine ? -0.1 : -1);
    default: break;
  }
  if (again) return;  // no repetition for a held key
  switch (key) {
    case GLFW_KEY_TAB:
      if (!state.settings.surfaces.empty())
        state.selected = (state.selected + 1) % state.settings.surfaces.size();
      return;
    case GLFW_KEY_F1: state.help = !state.help; return;
    case GLFW_KEY_ESCAPE:
      if (state.help)
        state.help = false;
      else if (state.import != nullptr)
        state.import->cancel();
      else
        state.requests.close = true;
      return;
    case GLFW_KEY_H: state.panels = !state.panels; return;
    case GLFW_KEY_R: state.requests.fit = fine ? FrameTarget::volume : FrameTarget::surface; return;
    case GLFW_KEY_F: next_mode(); return;
    case GLFW_KEY_P:
      state.navigator.camera.orthographic = !state.navigator.camera.orthographic;
      return;
    case GLFW_KEY_O: state.settings.occlusion = !state.settings.occlusion; return;
    case GLFW_KEY_L: state.settings.edges = !state.settings.edges; return;
    case GLFW_KEY_B: state.settings.box = !state.settings.box; return;
    case GLFW_KEY_M:
      state.measuring = !state.measuring;
      state.measured.clear();
      return;
    case GLFW_KEY_X: return look({-1, 0, 0});
    case GLFW_KEY_Y: return look({0, -1, 0});
    case GLFW_KEY_Z: return look({0, 0, -1});
    case GLFW_KEY_F12: state.requests.screenshot = "isobrick.png"; return;
    default: break;
  }
  if (!flying && key >= GLFW_KEY_1 && key <= GLFW_KEY_3) {
    auto& clip = state.settings.axis_clips[static_cast<std::size_t>(key - GLFW_KEY_1)];
    clip.on = !clip.on;
  }
}

}  // namespace isobrick
