#include <imgui.h>

#include <algorithm>
#include <string>

#include "tests/viewer/app/imgui_version.h"
#include "tests/viewer/app/window_test.h"
#include "viewer/app/panels.h"

// Displays with a scale.

namespace isobrick::inline v0 {
namespace {

using ScaledDisplay = test::WindowTest;

/// Number of pixels of axes and scale bar, in a window of the same size on each display.
int pixels_of_overlays(const std::string& store, int dots_per_inch) {
  const VirtualDisplay display(1000, 700, dots_per_inch);
  WindowOptions options;
  options.width = 800 * 96 / dots_per_inch;
  options.height = 600 * 96 / dots_per_inch;
  options.settings.box = options.settings.occlusion = options.settings.multisample = false;
  ViewerWindow window(options);
  window.open(store);
  window.state().panels = false;
  window.state().settings.surfaces[0].shown = false;
  const auto picture = [&](bool overlays) {
    window.state().settings.axes = window.state().settings.scale_bar = overlays;
    for (int i = 0; i < 500; ++i) {
      window.step(0.02);
      const FrameState& state = window.state().scene_renderer->state();
      if (i > 20 && state.complete && !state.moving && !state.reduced_quality) break;
    }
    EXPECT_EQ(window.state().scene_renderer->renderer().width(), 800);
    return window.state().scene_renderer->renderer().read_pixels();
  };
  const auto with = picture(true), without = picture(false);
  int pixels = 0;
  for (std::size_t i = 0; i < std::min(with.size(), without.size()); i += 4)
    pixels += !std::equal(&with[i], &with[i] + 3, &without[i]);
  return pixels;
}

TEST_F(ScaledDisplay, AxesAndScaleBarGrowWithTheDisplay) {
  display_.reset();
  const int one = pixels_of_overlays(dir_ / "sphere.zarr", 96),
            two = pixels_of_overlays(dir_ / "sphere.zarr", 192);
  EXPECT_GT(one, 400);
  // Text is a 45th of the picture high, 13 pixels, and at least 11 times the scale: so lines and
  // text are 1.65 times as large in both directions, except for the bar's length.
  EXPECT_GT(two, 1.8 * one);
}

TEST(ScaledWindow, DoublesEverything) {
  if (!VirtualDisplay::available()) GTEST_SKIP() << "there is no Xvfb";
  const VirtualDisplay display(1000, 700, 192);
  WindowOptions options;
  options.width = 400;
  options.height = 300;
  ViewerWindow window(options);
  int width = 0, height = 0;
  glfwGetFramebufferSize(window.handle(), &width, &height);
  EXPECT_EQ(width, 800);
  EXPECT_EQ(window.state().panel_width, 2 * kPanelWidth);
  EXPECT_EQ(test::font_pixels(), 2 * kFontPixels);
  EXPECT_GT(ImGui::GetStyle().FramePadding.x, 1.9f * ImGuiStyle().FramePadding.x);
}

}  // namespace
}  // namespace isobrick
