#include <gtest/gtest.h>

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>
#include <X11/keysym.h>
#include <signal.h>

#include <chrono>
#include <filesystem>

#include "isobrick/core/cancel.h"
#include "isobrick/pipeline/convert.h"
#include "isobrick/volumes/synth_source.h"
#include "isobrick/window/viewer_window.h"
#include "tests/io/temp_dir.h"
#include "tests/tools/program.h"
#include "tests/window/virtual_display.h"

namespace isobrick {
namespace {

/// Ways in which a window ends, or does not.
class WindowEnd : public testing::Test {
 protected:
  void SetUp() override {
    if (!VirtualDisplay::available()) GTEST_SKIP() << "there is no Xvfb";
    display_ = std::make_unique<VirtualDisplay>(320, 240);
    NoProgress progress;
    convert(*make_synth({.kind = SynthKind::sphere, .extent = {40, 40, 40}}), dir_ / "a.zarr", {},
            progress);
  }
  void TearDown() override { detail::cancel_requested = false; }

  ViewerWindow& open() {
    WindowOptions options;
    options.width = 320;
    options.height = 240;
    options.bookmarks = dir_ / "bookmarks.json";
    options.settings.occlusion = options.settings.multisample = false;
    window_ = std::make_unique<ViewerWindow>(options);
    window_->open(dir_ / "a.zarr");
    glfwSetWindowPos(window_->handle(), 0, 0);
    display_->move_pointer(160, 120);
    display_->focus_under_pointer();
    for (int i = 0; i < 3; ++i) EXPECT_TRUE(window_->step(0.02));
    return *window_;
  }
  /// Something that takes a while to convert.
  void drop_much() {
    const std::string file = dir_.write("b_1024x1024x1024_uint8.raw", "");
    std::filesystem::resize_file(file, std::uintmax_t{1} << 30);
    window_->drop(file);
    ASSERT_NE(window_->state().import, nullptr);
  }

  TempDir dir_;
  std::unique_ptr<VirtualDisplay> display_;
  std::unique_ptr<ViewerWindow> window_;
};

TEST_F(WindowEnd, ComesWhenOneIsAskedForAndLeavesNothingUnfinished) {
  open();
  drop_much();
  EXPECT_TRUE(window_->step(0.02));
  request_cancel();
  window_->run();
  window_.reset();
  EXPECT_EQ(dir_.list(), (std::vector<std::string>{"a.zarr", "b_1024x1024x1024_uint8.raw"}));
}

TEST_F(WindowEnd, EscapeCancelsAConversionFirst) {
  ViewerWindow& window = open();
  drop_much();
  EXPECT_TRUE(window.step(0.02));
  display_->tap(XK_Escape);
  const auto start = std::chrono::steady_clock::now();
  while (window.state().import != nullptr &&
         std::chrono::steady_clock::now() - start < std::chrono::seconds(60))
    ASSERT_TRUE(window.step(0.02)) << "the window is closed";
  EXPECT_EQ(window.state().import, nullptr);
  EXPECT_FALSE(std::filesystem::exists(dir_ / "b_1024x1024x1024_uint8.zarr"));
  display_->tap(XK_Escape);
  for (int i = 0; i < 50 && window.step(0.02); ++i) continue;
  EXPECT_FALSE(window.step(0.02));
}

TEST_F(WindowEnd, PicturesReplaceNoOther) {
  ViewerWindow& window = open();
  const std::filesystem::path before = std::filesystem::current_path();
  std::filesystem::current_path(dir_ / "");
  while (!window.state().picture->renderer().has_picture()) ASSERT_TRUE(window.step(0.02));
  for (std::size_t i = 0; i < 2; ++i) {
    window.state().requests.screenshot = "isobrick.png";
    const auto start = std::chrono::steady_clock::now();
    // Of the picture at rest, and so when there is one.
    while (window.state().messages.size() <= i &&
           std::chrono::steady_clock::now() - start < std::chrono::seconds(60))
      ASSERT_TRUE(window.step(0.02));
  }
  std::filesystem::current_path(before);
  ASSERT_EQ(window.state().messages.size(), 2u);
  EXPECT_TRUE(contains(window.state().messages[0], "/isobrick.png'"));
  EXPECT_TRUE(contains(window.state().messages[1], "/isobrick-2.png'"));
  EXPECT_TRUE(std::filesystem::exists(dir_ / "isobrick-2.png"));
}

#ifdef ISOBRICK_PROGRAM
TEST_F(WindowEnd, TheProgramEndsOfASignal) {
  const test::Arguments words{
      "timeout", "-s",      "KILL",          "30", ISOBRICK_PROGRAM, "view", dir_ / "a.zarr",
      "--size",  "320x240", "--no-occlusion"};
  EXPECT_EQ(test::run_process(words, {.interrupt_after = 2}).signal, SIGINT);
}
#endif

}  // namespace
}  // namespace isobrick
