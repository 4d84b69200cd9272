#include "viewer/app/navigation.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/vectors.h"

namespace isobrick::inline v0 {
namespace {

Navigator navigator(NavigationMode mode) {
  Navigator n;
  n.mode = mode;
  n.camera = Camera({3, -10, 2}, {0, 0, 0}, {0, 0, 1});
  n.camera.scene = {{0, 0, 0}, 4};
  return n;
}

void expect_orthonormal(const Camera& c) {
  EXPECT_NEAR(dot(c.right, c.up), 0, 1e-9);
  EXPECT_NEAR(dot(c.right, c.back), 0, 1e-9);
  EXPECT_NEAR(dot(c.up, c.back), 0, 1e-9);
  EXPECT_NEAR(length(c.right), 1, 1e-9);
  EXPECT_NEAR(length(c.back), 1, 1e-9);
}

class AllModes : public testing::TestWithParam<NavigationMode> {};

TEST_P(AllModes, ADragKeepsDistanceAndAxes) {
  Navigator n = navigator(GetParam());
  const double distance = n.camera.distance();
  for (int i = 0; i < 50; ++i) {
    n.rotate(0.03, -0.017, 0.016);
    n.update(0.016);
  }
  EXPECT_NEAR(n.camera.distance(), distance, 1e-6);
  expect_orthonormal(n.camera);
  EXPECT_NEAR(length(n.camera.target + n.camera.back * distance - n.camera.eye), 0, 1e-6);
}

TEST_P(AllModes, ASpinGoesOnAfterReleaseAndRunsOut) {
  Navigator n = navigator(GetParam());
  for (int i = 0; i < 5; ++i) n.rotate(0.02, 0, 0.016);
  EXPECT_FALSE(n.is_moving());
  n.release();
  const Vec3d before = n.camera.back;
  ASSERT_TRUE(n.update(0.016));
  EXPECT_GT(length(n.camera.back - before), 1e-3);
  double seconds = 0;
  while (n.update(0.016) && seconds < 10) seconds += 0.016;
  EXPECT_GT(seconds, 0.2);
  EXPECT_LT(seconds, 4);
}

TEST_P(AllModes, AHandThatHoldsStillStopsTheSpin) {
  Navigator n = navigator(GetParam());
  for (int i = 0; i < 5; ++i) n.rotate(0.02, 0, 0.016);
  for (int i = 0; i < 40; ++i) n.update(0.016);
  n.release();
  EXPECT_FALSE(n.update(0.016));
}

INSTANTIATE_TEST_SUITE_P(Navigator, AllModes,
                         testing::Values(NavigationMode::orbit, NavigationMode::trackball,
                                         NavigationMode::fly));

TEST(Navigator, OrbitsKeepTheVertical) {
  Navigator n = navigator(NavigationMode::orbit);
  for (int i = 0; i < 30; ++i) n.rotate(0.05, 0.01, 0.016);
  EXPECT_NEAR(n.camera.right.z, 0, 1e-9);
  EXPECT_EQ(n.camera.target, (Vec3d{0, 0, 0}));
}

TEST(Navigator, LookingAroundLeavesTheEye) {
  Navigator n = navigator(NavigationMode::fly);
  const Vec3d eye = n.camera.eye;
  n.rotate(0.3, 0.1, 0.1);
  EXPECT_EQ(n.camera.eye, eye);
  EXPECT_GT(length(n.camera.target), 0.1);
}

TEST(Navigator, KeysFlyAtTheSpeedWhateverTheFrames) {
  const auto flown = [](int frames) {
    Navigator n = navigator(NavigationMode::fly);
    const Vec3d eye = n.camera.eye;
    n.press({0, 0, 1});
    for (int i = 0; i < frames; ++i) n.update(2.0 / frames);
    return dot(n.camera.eye - eye, n.camera.back * -1.0);
  };
  // A quarter of the scene's radius a second, but for the first tenth or so.
  EXPECT_NEAR(flown(400), 0.25 * 4 * 2, 0.15);
  EXPECT_NEAR(flown(400), flown(60), 0.05);
}

TEST(Navigator, TheWheelZooms) {
  Navigator n = navigator(NavigationMode::orbit);
  const double distance = n.camera.distance();
  n.wheel(3);
  EXPECT_LT(n.camera.distance(), distance * 0.75);
  n.wheel(-3);
  EXPECT_NEAR(n.camera.distance(), distance, 1e-9);
}

}  // namespace
}  // namespace isobrick
