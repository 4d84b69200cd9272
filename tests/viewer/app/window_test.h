#pragma once

#include <gtest/gtest.h>

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>
#include <X11/keysym.h>

#include <chrono>
#include <functional>
#include <memory>
#include <string>

#include <isobrick/convert.h>
#include <isobrick/synth_source.h>
#include "tests/io/bytes/temp_dir.h"
#include "tests/viewer/app/virtual_display.h"
#include "viewer/app/viewer_window.h"

namespace isobrick::test {

inline constexpr int kWindowWidth = 640, kWindowHeight = 480;

/// A window that shows a sphere, with simulated input.
class WindowTest : public testing::Test {
 protected:
  void SetUp() override {
    if (!VirtualDisplay::available()) GTEST_SKIP() << "there is no Xvfb";
    display_ = std::make_unique<VirtualDisplay>(kWindowWidth, kWindowHeight);
    make_store("sphere.zarr", {96, 96, 96});
  }

  void make_store(const std::string& name, Int3 extent) {
    const auto source = make_synth({.kind = SynthKind::sphere, .extent = extent});
    NoProgress progress;
    convert(*source, dir_ / name, {.brick = 32}, progress);
  }

  ViewerWindow& open(WindowOptions options = {}) {
    options.width = kWindowWidth;
    options.height = kWindowHeight;
    options.bookmarks = dir_ / "bookmarks.json";
    options.cache.folder = dir_ / "cache";
    options.settings.occlusion = options.settings.multisample = false;  // slow in software
    window_ = std::make_unique<ViewerWindow>(options);
    window_->open(dir_ / "sphere.zarr");
    window_->state().panels = false;
    until([&] { return window_->state().scene_renderer->state().complete; });
    glfwSetWindowPos(window_->handle(), 0, 0);
    display_->move_pointer(kWindowWidth / 2, kWindowHeight / 2);
    display_->focus_under_pointer();
    steps(3);
    return *window_;
  }

  /// Whether the window shows a complete still frame.
  bool is_still() const {
    const FrameState& state = window_->state().scene_renderer->state();
    return state.complete && !state.moving;
  }
  /// Steps until holds() is true; fails after a minute.
  void until(const std::function<bool()>& holds) {
    const auto start = std::chrono::steady_clock::now();
    while (!holds()) {
      ASSERT_TRUE(window_->step(0.02));
      ASSERT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(60));
    }
  }
  void steps(int n) {
    for (int i = 0; i < n; ++i) ASSERT_TRUE(window_->step(0.02));
  }

  void drag(int button, int from_x, int from_y, int to_x, int to_y) {
    display_->move_pointer(from_x, from_y);
    steps(2);
    display_->button(button, true);
    steps(2);
    for (int i = 1; i <= 5; ++i) {
      display_->move_pointer(from_x + (to_x - from_x) * i / 5, from_y + (to_y - from_y) * i / 5);
      steps(2);
    }
    display_->button(button, false);
    steps(2);
  }
  void click(int x, int y) {
    display_->move_pointer(x, y);
    steps(2);
    display_->button(1, true);
    steps(2);
    display_->button(1, false);
    steps(3);
  }

  TempDir dir_;
  std::unique_ptr<VirtualDisplay> display_;
  std::unique_ptr<ViewerWindow> window_;
};

}  // namespace isobrick::test
