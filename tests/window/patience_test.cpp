#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <optional>

#include "tests/window/picture_test.h"

namespace isobrick {
namespace {

using Patience = Picture;

/// Pictures of what was chosen before, until there is time to choose.
constexpr PictureWay kNone{.patience_seconds = 0};

TEST_F(Patience, IsNotNeededForTheSamePictureInTheEnd) {
  open(SynthKind::gyroid, {64, 64, 64});
  settings_.pixel_error = 0.1f;  // everything as fine as it is, whatever was shown before
  settings_.surfaces[0].isovalue = 110;
  const auto expected = pixels();
  show();
  int behind = 0;
  for (int i = 80; i <= 110; ++i) {
    settings_.surfaces[0].isovalue = i;
    picture_->draw(camera_, kWidth, kHeight, settings_, kNone);
    behind += !picture_->scene().up_to_date();
    EXPECT_FALSE(picture_->state().complete && !picture_->scene().up_to_date());
    const double shown = picture_->state().isovalues[0];
    if (!picture_->scene().up_to_date()) {
      EXPECT_NE(shown, i) << "nothing of it was asked for";
    }
    EXPECT_TRUE(shown == i || !picture_->state().covers);
  }
  EXPECT_GT(behind, 10);
  for (int i = 0; i < 10000 && !picture_->state().complete; ++i) {
    picture_->draw(camera_, kWidth, kHeight, settings_, kNone);
    picture_->scene().stream().wait_idle(0.01);
  }
  EXPECT_TRUE(picture_->state().complete);
  EXPECT_EQ(picture_->renderer().read_pixels(), expected);
}

/// A device draws a picture in full once nothing finer is to come, and not while that is being
/// chosen.
TEST_F(Patience, WhatWasCompleteBeforeIsNot) {
  open(SynthKind::gyroid, {64, 64, 64});
  const PictureBudgets budgets;
  picture_ = std::make_unique<StorePicture>(
      std::make_shared<const StoreReader>(dir_ / "store.zarr"), budgets, [] {},
      std::make_shared<PictureSetup>(
          budgets, [] {}, std::nullopt, false));
  settings_.pixel_error = 0.5f;
  int pending = 0;
  // Where the cores are busy with other things the cut may be there before it is asked for.
  for (int turn = 0; turn < 300 && pending < 5; ++turn) {
    do {
      picture_->draw(camera_, kWidth, kHeight, settings_,
                     {.max_triangles = 2000, .plain = PictureWay::Plain::yes, .moving = true});
      EXPECT_FALSE(picture_->state().complete) << "a preview";
    } while (!picture_->scene().idle() || picture_->drew());
    picture_->draw(camera_, kWidth, kHeight, settings_,
                   {.plain = PictureWay::Plain::until_complete, .patience_seconds = 0});
    if (picture_->scene().up_to_date()) continue;
    ++pending;
    EXPECT_TRUE(!picture_->drew() || picture_->state().plain);
    EXPECT_FALSE(picture_->state().complete);
  }
  EXPECT_GT(pending, 0);
}

TEST_F(Patience, SurfacesThatAreHiddenAreNotTakenForOthers) {
  open(SynthKind::gyroid, {64, 64, 64});
  settings_.surfaces = {{90, surface_colour(0), 1, true},
                        {120, surface_colour(1), 1, true},
                        {150, surface_colour(2), 1, true}};
  draw();
  for (int hidden = 0; hidden < 3; ++hidden) {
    const auto place = static_cast<std::size_t>(hidden);
    settings_.surfaces[place].shown = false;
    picture_->draw(camera_, kWidth, kHeight, settings_, kNone);
    for (std::size_t i = 0; i < 3; ++i) {
      const double shown = picture_->state().isovalues[i];
      EXPECT_EQ(std::isnan(shown), i == place) << i;
      EXPECT_TRUE(shown == settings_.surfaces[i].isovalue || i == place);
    }
    settings_.surfaces[place].shown = true;
    draw();
  }
}

}  // namespace
}  // namespace isobrick
