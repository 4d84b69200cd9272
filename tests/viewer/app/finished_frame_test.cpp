#include <algorithm>
#include <tuple>
#include <vector>

#include <gtest/gtest.h>

#include <isobrick/convert.h>
#include <isobrick/synth_source.h>
#include "tests/viewer/app/window_test.h"
#include "viewer/app/viewer_window.h"

namespace isobrick::inline v0 {
namespace {

/// A finished frame of many triangles, and a pacer without time for them.
class FinishedFrame : public test::WindowTest {
 protected:
  void SetUp() override {
    WindowTest::SetUp();
    if (IsSkipped()) return;
    const auto source =
        make_synth({.kind = SynthKind::gyroid, .extent = {150, 150, 150}, .frequency = 4});
    NoProgress progress;
    convert(*source, dir_ / "many.zarr", {.brick = 32}, progress);
    ViewerWindow& window = open();
    window.open(dir_ / "many.zarr");
    window.state().settings.pixel_error = 0.3f;
    window.state().panels = true;
    rest();
    for (int i = 0; i < 20; ++i) window.state().pacer.add_preview(2, 10'000, true);
    triangles_ = triangles();
    ASSERT_GT(triangles_, 50'000u);
  }
  std::uint64_t triangles() const { return window_->state().scene_renderer->state().triangles; }
  void rest() {
    until([&] { return is_still(); });
    steps(3);
    until([&] { return is_still(); });
  }
  /// Presses, holds and releases the button; returns the minimum of triangles meanwhile.
  std::uint64_t least_while_clicking(int x, int y) {
    moved_ = false;
    std::uint64_t least = triangles();
    const auto step = [&](int n) {
      for (int i = 0; i < n; ++i) {
        steps(1);
        least = std::min(least, triangles());
        moved_ |= window_->state().scene_renderer->state().moving;
      }
    };
    display_->move_pointer(x, y);
    step(2);
    display_->button(1, true);
    step(15);
    display_->button(1, false);
    step(15);
    return least;
  }
  /// The values that sliders and the camera change: their motion causes previews.
  auto values() const {
    const ViewSettings& s = window_->state().settings;
    std::vector<float> places{s.pixel_error, s.surfaces[0].opacity, s.window_lo, s.window_hi};
    for (const AxisClipSettings& clip : s.axis_clips) places.push_back(clip.position);
    for (const SliceSettings& slice : s.slices) places.push_back(slice.position);
    for (const Vec3f corner : {s.region_lo, s.region_hi})
      places.insert(places.end(), {corner.x, corner.y, corner.z});
    return std::tuple(window_->state().navigator.camera, s.surfaces[0].isovalue,
                      s.surfaces[0].shown, places);
  }
  std::uint64_t triangles_ = 0;
  bool moved_ = false;  ///< a preview was drawn
};

TEST_F(FinishedFrame, IsNotLoweredByClicksOnWidgets) {
  // Clicks down the panel's first column and beside it: sections, radio buttons, boxes, buttons.
  int clicks = 0;
  for (int y = 35; y < test::kWindowHeight; y += 24) {
    if (y > 25 && y < 150) continue;  // the histogram is a slider
    for (const int x : {20, 50, 260}) {
      window_->state().settings.surfaces[0].shown = true;
      const auto before = values();
      const std::uint64_t least = least_while_clicking(x, y);
      if (values() == before) {
        ++clicks;
        EXPECT_FALSE(moved_) << x << ' ' << y;
        EXPECT_GE(least, triangles_) << x << ' ' << y;
      } else {
        rest();
        triangles_ = triangles();
      }
      if (window_->state().settings.surfaces.size() > 1)
        window_->state().settings.surfaces.resize(1);
      if (HasFailure()) return;
    }
  }
  EXPECT_GT(clicks, 25);
}

TEST_F(FinishedFrame, IsLoweredByASliderAndNeverCalledCompleteThen) {
  display_->move_pointer(100, 80);
  steps(2);
  display_->button(1, true);
  bool lowered = false;
  for (int i = 1; i <= 20; ++i) {
    display_->move_pointer(100 + 3 * i, 80);
    steps(1);
    const FrameState& state = window_->state().scene_renderer->state();
    if (!state.moving) continue;
    lowered |= state.triangles < triangles_ / 2;
    EXPECT_FALSE(state.complete);
  }
  EXPECT_TRUE(lowered);
  // With the mouse held still the still frame appears, even with the button down.
  rest();
  EXPECT_GT(triangles(), triangles_ / 2);
  display_->button(1, false);
  steps(3);
}

TEST_F(FinishedFrame, ComesBackWhereTheHandHoldsStill) {
  display_->move_pointer(520, 240);
  steps(2);
  display_->button(1, true);
  bool lowered = false;
  for (int i = 1; i <= 10; ++i) {
    display_->move_pointer(520 + 5 * i, 240);
    steps(1);
    lowered |= window_->state().scene_renderer->state().moving && triangles() < triangles_ / 2;
  }
  EXPECT_TRUE(lowered);
  rest();
  EXPECT_GT(triangles(), triangles_ / 2);
  display_->button(1, false);
  steps(3);
}

}  // namespace
}  // namespace isobrick
