#include "core/vectors.h"
#include "tests/viewer/app/window_test.h"

namespace isobrick::inline v0 {
namespace {

constexpr int kWidth = test::kWindowWidth, kHeight = test::kWindowHeight;
using Click = test::WindowTest;

TEST_F(Click, ClicksPickAndMeasure) {
  ViewerWindow& window = open();
  click(kWidth / 2, kHeight / 2);
  ASSERT_TRUE(window.state().picked);
  // On the sphere around the middle of the volume.
  EXPECT_EQ(window.state().picked->surface, 1u);
  display_->tap(XK_m);
  until([&] { return window.state().measuring; });
  click(kWidth / 2 - 30, kHeight / 2);
  click(kWidth / 2 + 30, kHeight / 2);
  ASSERT_EQ(window.state().measured.size(), 2u);
  EXPECT_GT(length(window.state().measured[1] - window.state().measured[0]), 1);
  click(3, 3);  // the background is no point
  EXPECT_EQ(window.state().measured.size(), 2u);
}

/// A button press does not cause a preview.
TEST_F(Click, ClicksPickFromThePictureAtRest) {
  ViewerWindow& window = open();
  for (int i = 0; i < 20; ++i) window.state().pacer.add_preview(2, 10'000, true);
  ASSERT_LT(window.state().pacer.max_triangles(), 4000u);
  until([&] { return is_still(); });
  const double isovalue = window.state().settings.surfaces[0].isovalue;
  const Vec3d eye = window.state().navigator.camera.eye;
  const auto triangles = window.state().scene_renderer->state().triangles;
  display_->move_pointer(kWidth / 2 + 40, kHeight / 2 - 50);
  steps(2);
  display_->button(1, true);
  steps(8);
  EXPECT_EQ(window.state().scene_renderer->state().triangles, triangles);
  display_->move_pointer(kWidth / 2 + 42, kHeight / 2 - 50);  // the mouse trembles
  steps(2);
  display_->button(1, false);
  steps(3);
  ASSERT_TRUE(window.state().picked && window.state().picked->value);
  EXPECT_NEAR(*window.state().picked->value, isovalue, 0.5);
  EXPECT_EQ(length(window.state().navigator.camera.eye - eye), 0);
}

TEST_F(Click, ATransparentSurfaceIsPickedAsWell) {
  ViewerWindow& window = open();
  window.state().settings.surfaces[0].opacity = 0.4f;
  until([&] { return is_still(); });
  steps(3);
  until([&] { return is_still(); });
  click(kWidth / 2 + 40, kHeight / 2 - 50);
  ASSERT_TRUE(window.state().picked && window.state().picked->value);
  EXPECT_EQ(window.state().picked->surface, 1u);
  EXPECT_NEAR(*window.state().picked->value, window.state().settings.surfaces[0].isovalue, 0.5);
}

/// A pick on a preview is repeated on the still frame.
TEST_F(Click, AClickBeforeThePictureRestsIsMadeGood) {
  ViewerWindow& window = open();
  for (int i = 0; i < 20; ++i) window.state().pacer.add_preview(2, 10'000, true);
  drag(3, kWidth / 2, kHeight / 2, kWidth / 2, kHeight / 2 + 20);
  window.state().measuring = true;
  click(kWidth / 2 + 40, kHeight / 2 - 50);
  ASSERT_TRUE(window.state().picked);
  EXPECT_TRUE(window.state().scene_renderer->state().moving);
  const double before = window.state().picked->value.value();
  const double isovalue = window.state().settings.surfaces[0].isovalue;
  until([&] { return is_still(); });
  steps(3);
  ASSERT_TRUE(window.state().picked->value);
  EXPECT_NE(*window.state().picked->value, before);
  EXPECT_NEAR(*window.state().picked->value, isovalue, 0.5);
  ASSERT_EQ(window.state().measured.size(), 1u);
  EXPECT_EQ(length(window.state().measured[0] - window.state().picked->world), 0);
}

/// A click on the background picks nothing, also on the still frame.
TEST_F(Click, AClickBesideTheSurfaceLeavesWhatWasMeasured) {
  ViewerWindow& window = open();
  until([&] { return is_still(); });
  window.state().measuring = true;
  click(kWidth / 2 + 40, kHeight / 2 - 50);
  ASSERT_EQ(window.state().measured.size(), 1u);
  const Vec3d point = window.state().measured[0];
  for (int i = 0; i < 20; ++i) window.state().pacer.add_preview(2, 10'000, true);
  display_->button(4, true);  // nearer
  display_->button(4, false);
  steps(1);
  click(3, 3);
  until([&] { return is_still(); });
  steps(3);
  ASSERT_EQ(window.state().measured.size(), 1u);
  EXPECT_EQ(length(window.state().measured[0] - point), 0);
}

}  // namespace
}  // namespace isobrick
