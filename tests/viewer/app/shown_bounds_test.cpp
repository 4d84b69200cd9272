#include <gtest/gtest.h>

#include <algorithm>

#include "tests/viewer/app/scene_renderer_fixture.h"

// The finest level of a picture, and its framing.

namespace isobrick::inline v0 {
namespace {

using ShownBounds = SceneRendererTest;

TEST_F(ShownBounds, ShowsNoFinerLevelThanItsSettingsSay) {
  open(SynthKind::gyroid, {128, 128, 128});
  settings_.pixel_error = 0.1f;
  draw();
  const double finest = static_cast<double>(scene_renderer_->state().triangles);
  const auto levels = static_cast<int>(scene_renderer_->store().info().levels.size());
  ASSERT_GE(levels, 3);
  for (int level = 1; level <= levels + 3; ++level) {
    settings_.finest_level = level;
    draw();
    EXPECT_TRUE(scene_renderer_->state().complete);
    const NodeGrid& grid = scene_renderer_->scene().tree().grid();
    for (const CutNode& node : scene_renderer_->scene().cut().nodes)
      EXPECT_EQ(grid.level(node.key.level).source, std::min(level, levels - 1));
    EXPECT_LT(static_cast<double>(scene_renderer_->state().triangles), 0.4 * finest) << level;
  }
}

TEST_F(ShownBounds, WhatIsShownHasBounds) {
  open(SynthKind::sphere, {96, 96, 96});
  const WorldBox volume = scene_renderer_->bounds();
  settings_.surfaces[0].isovalue = 200;
  const WorldBox ball = scene_renderer_->shown_bounds(settings_);
  for (int axis = 0; axis < 3; ++axis) {
    EXPECT_GT(ball.lo[axis], volume.lo[axis]);
    EXPECT_LT(ball.hi[axis], volume.hi[axis]);
    EXPECT_NEAR(ball.lo[axis] + ball.hi[axis], 95, 1.01) << "it is in the middle";
  }
  // Within a region, and with a slice.
  settings_.region_on = true;
  settings_.region_hi = {0.5f, 1, 1};
  EXPECT_EQ(scene_renderer_->shown_bounds(settings_).hi.x, 47.5);
  settings_.slices[2] = {true, 1};
  const WorldBox sliced = scene_renderer_->shown_bounds(settings_);
  EXPECT_EQ(sliced.lo.x, 0);
  EXPECT_EQ(sliced.hi.x, 47.5);
  EXPECT_EQ(sliced.hi.z, 95);
  EXPECT_EQ(sliced.lo.z, ball.lo.z);
  // The whole volume if nothing is shown.
  settings_.slices[2].shown = settings_.surfaces[0].shown = false;
  EXPECT_EQ(scene_renderer_->shown_bounds(settings_).hi, volume.hi);
  EXPECT_EQ(scene_renderer_->shown_bounds(settings_).lo, volume.lo);
}

}  // namespace
}  // namespace isobrick
