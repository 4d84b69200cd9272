#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include <isobrick/error.h>
#include "tests/io/meshes/test_meshes.h"
#include "tests/viewer/render/pictures.h"

namespace isobrick::inline v0 {
namespace {

constexpr int kWidth = 200, kHeight = 160;

Camera front_camera() {
  Camera camera({0, -1, 0}, {0, 0, 0}, {0, 0, 1});
  camera.fit({-1, -1, -1}, {1, 1, 1}, 1.25);
  return camera;
}

/// A grid of cells × cells in the plane y = `y`, with edges of length 2·half.
TestMesh make_sheet(float y, float half, std::uint32_t cells) {
  TestMesh mesh;
  for (std::uint32_t i = 0; i <= cells; ++i)
    for (std::uint32_t k = 0; k <= cells; ++k) {
      const auto at = [&](std::uint32_t n) {
        return half * (2 * static_cast<float>(n) / static_cast<float>(cells) - 1);
      };
      mesh.positions.push_back({at(k), y, at(i)});
      mesh.normals.push_back({0, -1, 0});
    }
  for (std::uint32_t i = 0; i < cells; ++i)
    for (std::uint32_t k = 0; k < cells; ++k) {
      const std::uint32_t a = i * (cells + 1) + k, b = a + cells + 1;
      mesh.triangles.push_back({a, a + 1, b});
      mesh.triangles.push_back({b, a + 1, b + 1});
    }
  return mesh;
}

using Shading = RenderTest;

TEST_F(Shading, LightComesFromAboveAndLeft) {
  const TestMesh ball = make_ball({0, 0, 0}, 1, 60);
  renderer().begin(front_camera(), kWidth, kHeight, {});
  renderer().draw(ball.chunk(), {});
  renderer().end();
  const Pixels pixels(renderer());
  EXPECT_GT(pixels.brightness(85, 60), pixels.brightness(115, 100) + 60);
}

TEST_F(Shading, TransparencyDoesNotDependOnTheOrder) {
  std::vector<TestMesh> sheets;
  for (int i = 0; i < 5; ++i)
    sheets.push_back(make_sheet(static_cast<float>(i) * 0.4f - 0.8f, 0.8f, 4));
  const std::vector<Vec3f> colours{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 1, 0}, {0, 1, 1}};
  std::vector<std::size_t> order{0, 1, 2, 3, 4};
  std::mt19937 random(7);
  std::vector<std::uint8_t> first;
  for (int trial = 0; trial < 4; ++trial) {
    renderer().begin(front_camera(), kWidth, kHeight, {});
    for (const std::size_t i : order)
      renderer().draw(sheets[i].chunk(), {.colour = colours[i], .opacity = 0.4f});
    renderer().end();
    const std::vector<std::uint8_t> rgba = renderer().read_pixels();
    if (first.empty()) first = rgba;
    int most = 0;
    for (std::size_t i = 0; i < rgba.size(); ++i)
      most = std::max(most, std::abs(int{rgba[i]} - int{first[i]}));
    EXPECT_LE(most, 3) << trial;
    std::shuffle(order.begin(), order.end(), random);
  }
}

TEST_F(Shading, TheNearestOfTransparentMeshesCountsMost) {
  const TestMesh front = make_sheet(-0.8f, 0.8f, 4), back = make_sheet(0.8f, 0.8f, 4);
  renderer().begin(front_camera(), kWidth, kHeight, {});
  renderer().draw(back.chunk(), {.colour = {0, 0, 1}, .opacity = 0.6f});
  renderer().draw(front.chunk(), {.colour = {1, 0, 0}, .opacity = 0.6f});
  renderer().end();
  const Pixels pixels(renderer());
  EXPECT_GT(pixels.at(100, 80)[0], pixels.at(100, 80)[2] + 40);
}

TEST_F(Shading, AnOpaqueMeshHidesTransparentOnesBehindIt) {
  const TestMesh front = make_sheet(-0.8f, 0.8f, 4), back = make_sheet(0.8f, 0.5f, 4);
  std::vector<std::vector<std::uint8_t>> pictures;
  for (const bool with_back : {false, true}) {
    renderer().begin(front_camera(), kWidth, kHeight, {});
    renderer().draw(front.chunk(), {});
    if (with_back) renderer().draw(back.chunk(), {.colour = {0, 0, 1}, .opacity = 0.5f});
    renderer().end();
    pictures.push_back(renderer().read_pixels());
  }
  EXPECT_EQ(pictures[0], pictures[1]);
}

TEST_F(Shading, PlanesCutAndShowAnotherTone) {
  const TestMesh ball = make_ball({0, 0, 0}, 1, 60);
  PictureSettings settings;
  settings.planes = {{{-1, 0, 0}, 0}};  // the left half stays
  renderer().begin(front_camera(), kWidth, kHeight, settings);
  renderer().draw(ball.chunk(), {});
  renderer().end();
  const Pixels half(renderer());
  EXPECT_TRUE(half.surface(80, 80));
  EXPECT_FALSE(half.surface(103, 80));
  settings.planes = {{{0, 1, 0}, 0}};  // the back half stays; its inside is visible
  renderer().begin(front_camera(), kWidth, kHeight, settings);
  renderer().draw(ball.chunk(), {.colour = {0.8f, 0.8f, 0.8f}, .inside = Vec3f{0, 0, 1}});
  renderer().end();
  const Pixels open(renderer());
  EXPECT_GT(open.at(100, 80)[2], open.at(100, 80)[0] + 60);
}

TEST_F(Shading, ARegionCutsAllSixSides) {
  const TestMesh sheet = make_sheet(0, 1, 20);
  PictureSettings settings;
  settings.region = WorldBox{{-0.5, -0.5, -0.25}, {0.5, 0.5, 0.25}};
  // More half spaces than OpenGL's clip distances.
  for (int i = 0; i < 4; ++i) settings.planes.push_back({{0, -1, 0}, -5});
  Camera camera = front_camera();
  camera.orthographic = true;
  renderer().begin(camera, kWidth, kHeight, settings);
  renderer().draw(sheet.chunk(), {});
  renderer().end();
  const double pixel = camera.extent_at(camera.distance()) / kHeight;
  EXPECT_NEAR(Pixels(renderer()).count_surface(), 0.5 / (pixel * pixel),
              0.05 * 0.5 / (pixel * pixel));
}

TEST_F(Shading, HollowsAreDarkerWithOcclusion) {
  // A bowl: the back half of a ball, seen from inside.
  const TestMesh ball = make_ball({0, 0, 0}, 1, 60);
  int brightness[2];
  for (const bool occlusion : {false, true}) {
    PictureSettings settings{.occlusion = occlusion};
    settings.planes = {{{0, 1, 0}, 0}};
    renderer().begin(front_camera(), kWidth, kHeight, settings);
    renderer().draw(ball.chunk(), {});
    renderer().end();
    brightness[occlusion] = Pixels(renderer()).brightness(100, 80);
  }
  EXPECT_LT(brightness[1], brightness[0] - 15);
}

TEST_F(Shading, EdgesAreDarkWhereDepthBreaksOff) {
  const TestMesh back = make_sheet(0.5f, 1, 4), front = make_sheet(-0.5f, 0.3f, 4);
  PictureSettings settings{.occlusion = false, .edges = true};
  renderer().begin(front_camera(), kWidth, kHeight, settings);
  renderer().draw(back.chunk(), {});
  renderer().draw(front.chunk(), {});
  renderer().end();
  const Pixels pixels(renderer());
  const int flat = pixels.brightness(100, 80);
  int darkest = flat;
  for (int x = 60; x < 100; ++x) darkest = std::min(darkest, pixels.brightness(x, 80));
  EXPECT_LT(darkest, flat * 3 / 4);
}

TEST_F(Shading, FarFromTheOriginNothingJitters) {
  const TestMesh ball = make_ball({0, 0, 0}, 1, 60);
  std::vector<std::vector<std::uint8_t>> pictures;
  for (const double far : {0.0, 1e9}) {
    const Vec3d origin{far, -far, far};
    Camera camera = front_camera();
    camera.eye = camera.eye + origin;
    camera.target = origin;
    camera.scene.centre = origin;
    renderer().begin(camera, kWidth, kHeight, {});
    renderer().draw(ball.chunk(), {}, origin);
    renderer().end();
    pictures.push_back(renderer().read_pixels());
  }
  int apart = 0;
  for (std::size_t i = 0; i < pictures[0].size(); ++i)
    apart += std::abs(int{pictures[0][i]} - int{pictures[1][i]}) > 4;
  EXPECT_LT(apart, 60);
}

TEST_F(Shading, ASliceShowsItsSamplesThroughTheWindow) {
  const std::vector<float> samples{0, 100, 200, std::nanf("")};
  SliceImage slice{{-0.8, 0, -0.8}, {1.6, 0, 0}, {0, 0, 1.6}, 2, 2, samples, 0, 200};
  renderer().begin(front_camera(), kWidth, kHeight, {});
  renderer().draw(slice);
  renderer().end();
  const Pixels pixels(renderer());
  EXPECT_LT(pixels.brightness(75, 105), 10);                // lower left: black
  EXPECT_GT(pixels.brightness(75, 55), 740);                // upper left: white
  EXPECT_NEAR(pixels.brightness(125, 105), 3 * 188, 12);    // half the light
  EXPECT_GT(pixels.at(125, 55)[2], pixels.at(125, 55)[0]);  // background
  slice.width = 3;
  EXPECT_THROW(renderer().draw(slice), Error);
}

TEST_F(Shading, OverlaysAreDrawnAndHidden) {
  const TestMesh sheet = make_sheet(-0.5f, 0.5f, 4);
  renderer().begin(front_camera(), kWidth, kHeight, {});
  renderer().draw(sheet.chunk(), {});
  const WorldLine line{{-1, 0, 0}, {1, 0, 0}};
  renderer().draw_lines({&line, 1}, {0, 0, 1}, 3);
  renderer().draw_scale_bar("mm");
  renderer().draw_axes();
  renderer().end();
  const Pixels pixels(renderer());
  EXPECT_GT(pixels.at(60, 80)[2], pixels.at(60, 80)[0] + 100) << "beside the sheet";
  EXPECT_LT(pixels.at(100, 80)[2], pixels.at(100, 80)[0] + 20) << "behind the sheet";
}

TEST_F(Shading, ScaleBarsHaveAText) {
  std::vector<std::vector<std::uint8_t>> pictures;
  for (const char* unit : {"", "mm", "km"}) {
    renderer().begin(front_camera(), kWidth, kHeight, {});
    renderer().draw_scale_bar(unit);
    renderer().end();
    pictures.push_back(renderer().read_pixels());
  }
  EXPECT_NE(pictures[0], pictures[1]);
  EXPECT_NE(pictures[1], pictures[2]);
}

TEST_F(Shading, OneSampleAPixelDrawsTheSameThing) {
  const TestMesh ball = make_ball({0, 0, 0}, 1, 60);
  std::vector<int> counts;
  for (const bool multisample : {false, true}) {
    renderer().begin(front_camera(), kWidth, kHeight, {.multisample = multisample});
    renderer().draw(ball.chunk(), {});
    renderer().draw(make_sheet(-1, 0.2f, 2).chunk(), {.colour = {0, 0, 1}, .opacity = 0.2f});
    renderer().end();
    counts.push_back(Pixels(renderer()).count_surface());
  }
  EXPECT_NEAR(counts[0], counts[1], 0.03 * counts[1]);
}

TEST_F(Shading, TheSamePictureTwice) {
  const TestMesh ball = make_ball({0, 0, 0}, 1, 60);
  std::vector<std::vector<std::uint8_t>> pictures;
  for (int i = 0; i < 2; ++i) {
    Renderer fresh;
    fresh.begin(front_camera(), kWidth, kHeight, {.edges = true});
    fresh.draw(ball.chunk(), {});
    fresh.draw(make_sheet(-1, 0.5f, 3).chunk(), {.opacity = 0.3f});
    fresh.draw_axes();
    fresh.end();
    pictures.push_back(fresh.read_pixels());
  }
  EXPECT_EQ(pictures[0], pictures[1]);
}

}  // namespace
}  // namespace isobrick
