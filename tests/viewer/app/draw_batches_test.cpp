#include <gtest/gtest.h>

#include <cstdint>

#include <isobrick/error.h>
#include "tests/viewer/app/scene_renderer_fixture.h"

namespace isobrick::inline v0 {
namespace {

/// A limit so short that a frame takes many batches on any machine.
constexpr double kShort = 1e-4;

using DrawBatches = SceneRendererTest;

TEST_F(DrawBatches, GiveTheSamePicture) {
  open(SynthKind::gyroid, {96, 96, 96});
  damage_bricks();
  show();
  settings_.surfaces.push_back({100, surface_colour(1), 0.4f, true});
  settings_.slices[1] = {true, 0.5f};
  settings_.axis_clips[0] = {true, 0.8f, true};
  settings_.planes = {{true, {{0.3, 1, 0.2}, 10}}};
  settings_.edges = settings_.box = settings_.axes = settings_.scale_bar = true;
  settings_.pixel_error = 3;
  choose_values(settings_, scene_renderer_->scene().tree());
  const FrameOptions whole, batches{.batch_seconds = kShort};
  const auto pixels_of = [&](const FrameOptions& options) {
    scene_renderer_->renderer().discard();
    for (int i = 0; i < 2 || !scene_renderer_->state().complete; ++i) {
      scene_renderer_->draw(camera_, kWidth, kHeight, settings_, options);
      if (!scene_renderer_->state().drawing) scene_renderer_->scene().stream().wait_idle(1);
    }
    EXPECT_FALSE(scene_renderer_->state().damage.empty());
    return scene_renderer_->renderer().read_pixels();
  };
  for (const bool multisample : {false, true}) {
    settings_.multisample = multisample;
    const auto expected = pixels_of(whole);
    const std::uint64_t before = scene_renderer_->counters().unfinished_batches;
    settings_.occlusion = false;  // another frame in between
    EXPECT_NE(pixels_of(batches), expected);
    settings_.occlusion = true;
    EXPECT_EQ(pixels_of(batches), expected) << multisample;
    EXPECT_GE(scene_renderer_->counters().unfinished_batches, before + 10);
  }
  EXPECT_EQ(scene_renderer_->counters().dropped, 0u);
}

TEST_F(DrawBatches, AreDroppedWhenTheViewChangesUnlessItKeepsChanging) {
  open(SynthKind::gyroid, {96, 96, 96});
  const auto first = pixels();
  FrameOptions options{.batch_seconds = kShort};
  const auto draw_one = [&](double turn) {
    if (turn != 0) camera_.orbit(turn, 0, {0, 0, 1});
    scene_renderer_->draw(camera_, kWidth, kHeight, settings_, options);
  };
  const FrameCounters& counters = scene_renderer_->counters();
  const FrameCounters before = counters;
  draw_one(0.3);
  draw_one(0);
  EXPECT_TRUE(scene_renderer_->state().drawing);
  EXPECT_FALSE(scene_renderer_->state().complete);
  EXPECT_EQ(counters.unfinished_batches, before.unfinished_batches + 2);
  EXPECT_EQ(counters.dropped, 0u);
  draw_one(0.3);
  EXPECT_EQ(counters.dropped, 1u);
  settings_.surfaces[0].isovalue += 7;  // counts as another view
  draw_one(0);
  EXPECT_EQ(counters.dropped, 2u);
  EXPECT_EQ(counters.finished, before.finished);
  EXPECT_EQ(scene_renderer_->renderer().read_pixels(), first) << "what is not whole is not shown";
  // During continuous motion no frame would ever finish otherwise.
  options.moving = true;
  draw_one(0.1);
  EXPECT_EQ(counters.dropped, 3u);
  for (int i = 0; counters.finished == before.finished; ++i) {
    ASSERT_LT(i, 100000);
    draw_one(1e-3);
  }
  EXPECT_TRUE(scene_renderer_->has_new_frame());
  EXPECT_TRUE(scene_renderer_->state().moving);
  // After the motion a still frame replaces the preview.
  draw_one(0);
  ASSERT_TRUE(scene_renderer_->state().drawing);
  options.moving = false;
  draw_one(1e-3);
  const std::uint64_t dropped = counters.dropped;
  EXPECT_GE(dropped, 4u);
  while (!scene_renderer_->state().complete) draw_one(0);
  EXPECT_EQ(counters.dropped, dropped);
}

TEST_F(DrawBatches, OfPicturesWithoutTrianglesAreFinishedWhileTheViewKeepsChanging) {
  open(SynthKind::gyroid, {96, 96, 96});
  settings_.surfaces[0].shown = false;
  settings_.slices[1] = {true, 0.5f};
  choose_values(settings_, scene_renderer_->scene().tree());
  draw();
  const FrameCounters before = scene_renderer_->counters();
  const FrameOptions options{.batch_seconds = kShort, .moving = true};
  for (int i = 0; scene_renderer_->counters().finished < before.finished + 3; ++i) {
    ASSERT_LT(i, 10000);
    camera_.orbit(1e-3, 0, {0, 0, 1});
    scene_renderer_->draw(camera_, kWidth, kHeight, settings_, options);
  }
  EXPECT_GT(scene_renderer_->counters().unfinished_batches, before.unfinished_batches)
      << "there is nothing to be finished";
  EXPECT_EQ(scene_renderer_->counters().dropped, before.dropped);
}

TEST_F(DrawBatches, NothingIsBeingDrawnAfterAFailure) {
  open(SynthKind::gyroid, {96, 96, 96}, {.backend = Backend::cpu});
  const auto first = pixels();
  const std::uint64_t finished = scene_renderer_->counters().finished;
  ASSERT_TRUE(scene_renderer_->state().complete);
  const auto fail = [&] {
    EXPECT_THROW(scene_renderer_->draw(camera_, 1 << 24, kHeight, settings_), UsageError);
    EXPECT_FALSE(scene_renderer_->has_new_frame());
    EXPECT_FALSE(scene_renderer_->state().drawing);
    EXPECT_FALSE(scene_renderer_->state().needs_draw);
    EXPECT_FALSE(scene_renderer_->state().complete);
    EXPECT_EQ(scene_renderer_->state().drawn_fraction, 0);
  };
  fail();
  // An unfinished frame is dropped, too.
  const FrameOptions options{.batch_seconds = kShort};
  const Camera front = camera_;
  camera_.orbit(0.3, 0, {0, 0, 1});
  for (int i = 0; i < 3; ++i) scene_renderer_->draw(camera_, kWidth, kHeight, settings_, options);
  ASSERT_TRUE(scene_renderer_->state().drawing);
  ASSERT_GT(scene_renderer_->state().drawn_fraction, 0);
  fail();
  EXPECT_EQ(scene_renderer_->counters().finished, finished);
  EXPECT_EQ(scene_renderer_->renderer().read_pixels(), first);
  EXPECT_NE(pixels(), first);
  camera_ = front;
  EXPECT_EQ(pixels(), first);
}

}  // namespace
}  // namespace isobrick
