#include "viewer/render/renderer.h"

#include <epoxy/gl.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "tests/io/meshes/test_meshes.h"
#include "tests/viewer/render/pictures.h"
#include "viewer/render/gl_objects.h"

namespace isobrick::inline v0 {
namespace {

Camera front_camera(double aspect) {
  Camera camera({0, -1, 0}, {0, 0, 0}, {0, 0, 1});
  camera.fit({-1, -1, -1}, {1, 1, 1}, aspect);
  return camera;
}

TEST_F(RenderTest, ABallIsADiscOfTheRightSize) {
  MeshPool pool;
  const TestMesh ball = make_ball({0, 0, 0}, 1, 100);
  const PooledMesh mesh = pool.add(ball.chunk());
  const Camera camera = front_camera(1.25);
  renderer().begin(camera, 200, 160, {});
  renderer().draw(mesh, {});
  renderer().end();
  const Pixels pixels(renderer());
  // Rays tangent to the ball leave the eye at asin(1 / distance).
  const double angle = std::asin(1 / camera.distance());
  const double radius = std::tan(angle) / (camera.extent_at(1) / 160);
  EXPECT_NEAR(pixels.count_surface(), 3.14159265 * radius * radius, 0.02 * 3.14 * radius * radius);
  EXPECT_TRUE(pixels.surface(100, 80));
  EXPECT_FALSE(pixels.surface(3, 3));
}

TEST_F(RenderTest, PickingTellsPlaceAndMesh) {
  const TestMesh ball = make_ball({0, 0, 0}, 1, 200);
  renderer().begin(front_camera(1.25), 200, 160, {.picking = true});
  renderer().draw(ball.chunk(), {.id = 7});
  renderer().end();
  const std::optional<PickResult> picked = renderer().pick(110, 60);
  ASSERT_TRUE(picked);
  EXPECT_EQ(picked->id, 7u);
  const Vec3d p = picked->position;
  EXPECT_NEAR(std::sqrt(p.x * p.x + p.y * p.y + p.z * p.z), 1, 1e-3);
  EXPECT_GT(p.x, 0);
  EXPECT_GT(p.z, 0);
  EXPECT_FALSE(renderer().pick(3, 3));
  EXPECT_FALSE(renderer().pick(-1, 80));
}

double distance_from_middle(const PickResult& picked) {
  const Vec3d p = picked.position;
  return std::sqrt(p.x * p.x + p.y * p.y + p.z * p.z);
}

/// A small opaque ball in a transparent one in a larger one; else background.
TEST_F(RenderTest, TransparentMeshesCanBePicked) {
  const TestMesh small = make_ball({0, 0, 0}, 0.3f, 100), middle = make_ball({0, 0, 0}, 0.6f, 100),
                 large = make_ball({0, 0, 0}, 1, 200);
  for (const bool orthographic : {false, true})
    for (const bool multisample : {false, true})
      for (const bool cut : {false, true}) {
        SCOPED_TRACE(testing::Message() << orthographic << multisample << cut);
        Camera camera = front_camera(1.25);
        camera.orthographic = orthographic;
        PictureSettings settings{.multisample = multisample, .picking = true};
        // Clips the near half of the large balls.
        if (cut) settings.planes = {{{0, 1, 0}, -0.31}};
        renderer().begin(camera, 200, 160, settings);
        renderer().draw(small.chunk(), {.id = 3});
        renderer().draw(large.chunk(), {.opacity = 0.2f, .id = 5});
        renderer().draw(middle.chunk(), {.opacity = 0.2f, .id = 4});
        renderer().end();
        const std::optional<PickResult> picked = renderer().pick(100, 80);
        ASSERT_TRUE(picked);
        EXPECT_EQ(picked->id, cut ? 3u : 5u);
        EXPECT_NEAR(distance_from_middle(*picked), cut ? 0.3 : 1, 2e-3);
        EXPECT_FALSE(renderer().pick(3, 3));
        // The next picture has no transparent meshes.
        renderer().begin(camera, 200, 160, settings);
        renderer().draw(small.chunk(), {.id = 3});
        renderer().end();
        ASSERT_TRUE(renderer().pick(100, 80));
        EXPECT_EQ(renderer().pick(100, 80)->id, 3u);
      }
}

/// Triangles that cover a part of a pixel are picked at their own depth, not at that of their
/// plane.
TEST_F(RenderTest, TransparentEdgesArePickedOnTheSurface) {
  for (const bool orthographic : {false, true})
    for (const int segments : {30, 100}) {
      const TestMesh ball = make_ball({0, 0, 0}, 1, segments);
      Camera camera = front_camera(1.25);
      camera.orthographic = orthographic;
      renderer().begin(camera, 200, 160, {.picking = true});
      renderer().draw(ball.chunk(), {.opacity = 0.5f, .id = 5});
      renderer().end();
      int hits = 0;
      for (int y = 0; y < 160; ++y)
        for (int x = 0; x < 200; ++x)
          if (const auto picked = renderer().pick(x, y)) {
            ++hits;
            EXPECT_NEAR(distance_from_middle(*picked), 1, 0.03) << x << ' ' << y;
          }
      EXPECT_GT(hits, 3000);
    }
}

/// Number of pixels with the blue of the z axis.
template <class Rgba>
int count_blue(const Rgba& rgba) {
  int blue = 0;
  for (std::size_t i = 0; i + 3 < rgba.size(); i += 4)
    blue += rgba[i + 2] > 150 && rgba[i] < 90 && rgba[i + 1] < 120;
  return blue;
}

TEST_F(RenderTest, OverlaysOfASmallPictureAreAsLargeAsWhatShowsIt) {
  constexpr int kWidth = 400, kHeight = 320;
  const auto draw = [&](int size_divisor, const PictureSettings& settings) {
    renderer().begin(front_camera(1.25), kWidth / size_divisor, kHeight / size_divisor, settings);
    renderer().draw(make_ball({0, 0, 0}, 0.5f, 60).chunk(), {});
    renderer().draw_box({-1, -1, -1}, {1, 1, 1}, {0.1f, 0.1f, 0.9f}, 3);
    renderer().draw_axes();
    renderer().draw_scale_bar("mm");
    renderer().end();
  };
  draw(1, {});
  const int wanted = count_blue(renderer().read_pixels());
  EXPECT_GT(wanted, 500);
  draw(4, {.defer_overlays = true});
  EXPECT_EQ(count_blue(renderer().read_pixels()), 0);
  const GlTexture shown = make_texture(GL_RGBA8, kWidth, kHeight, 1, "a window");
  const GlFramebuffer window = make_framebuffer(std::array{shown.get()}, 0, "a window");
  renderer().copy_to(window.get(), kWidth, kHeight);
  std::vector<std::uint8_t> rgba(std::size_t{4} * kWidth * kHeight);
  glGetTextureImage(shown.get(), 0, GL_RGBA, GL_UNSIGNED_BYTE, static_cast<int>(rgba.size()),
                    rgba.data());
  EXPECT_NEAR(count_blue(rgba), wanted, 0.03 * wanted);
  // Surfaces also hide them if the picture has fewer pixels.
  draw(1, {.defer_overlays = true});
  renderer().copy_to(window.get(), kWidth, kHeight);
  glGetTextureImage(shown.get(), 0, GL_RGBA, GL_UNSIGNED_BYTE, static_cast<int>(rgba.size()),
                    rgba.data());
  EXPECT_EQ(count_blue(rgba), wanted);
}

/// Width and height of the difference between the columns `from` and `to`.
std::array<int, 2> extent_of_difference(const Pixels& a, const Pixels& b, int from, int to) {
  int left = to, right = from - 1, top = a.height, bottom = -1;
  for (int y = 0; y < a.height; ++y)
    for (int x = from; x < to; ++x) {
      if (a.brightness(x, y) == b.brightness(x, y)) continue;
      left = std::min(left, x);
      right = std::max(right, x);
      top = std::min(top, y);
      bottom = std::max(bottom, y);
    }
  return {right - left + 1, bottom - top + 1};
}

TEST_F(RenderTest, OverlaysAreTwiceAsLargeOnADisplayOfTwiceTheScale) {
  constexpr int kWidth = 400, kHeight = 320;
  const auto draw = [&](float scale, bool overlays) {
    renderer().begin(front_camera(1.25), kWidth, kHeight,
                     {.occlusion = false, .overlay_scale = scale});
    if (overlays) {
      renderer().draw_axes();
      renderer().draw_scale_bar("mm");
    }
    renderer().end();
    return Pixels(renderer());
  };
  const Pixels none = draw(1, false), one = draw(1, true), two = draw(2, true);
  const auto axes = extent_of_difference(one, none, 0, kWidth / 2),
             axes_2 = extent_of_difference(two, none, 0, kWidth / 2);
  EXPECT_GT(axes[0], 25);
  EXPECT_NEAR(axes_2[0], 2 * axes[0], 3);
  EXPECT_NEAR(axes_2[1], 2 * axes[1], 3);
  // The bar has the length that its text states; with its text it is twice as high.
  const auto bar = extent_of_difference(one, none, kWidth / 2, kWidth),
             bar_2 = extent_of_difference(two, none, kWidth / 2, kWidth);
  EXPECT_GT(bar[1], 12);
  EXPECT_NEAR(bar_2[1], 2 * bar[1], 3);
  EXPECT_LT(bar_2[0], 1.3 * bar[0]);

  const auto blue = [&](float scale) {
    renderer().begin(front_camera(1.25), kWidth, kHeight, {.overlay_scale = scale});
    renderer().draw_box({-1, -1, -1}, {1, 1, 1}, {0.1f, 0.1f, 0.9f}, 3);
    renderer().end();
    return count_blue(renderer().read_pixels());
  };
  const int thin = blue(1);
  EXPECT_NEAR(blue(2), 2 * thin, 0.25 * thin);
}

/// A mesh behind an opaque mesh is not picked.
TEST_F(RenderTest, TransparentMeshesBehindOpaqueOnesAreNotPicked) {
  const TestMesh near = make_ball({0, -0.5f, 0}, 0.15f, 100),
                 far = make_ball({0, 0.5f, 0}, 0.5f, 100);
  renderer().begin(front_camera(1.25), 200, 160, {.picking = true});
  renderer().draw(near.chunk(), {.id = 1});
  renderer().draw(far.chunk(), {.opacity = 0.5f, .id = 2});
  renderer().end();
  ASSERT_TRUE(renderer().pick(100, 80));
  EXPECT_EQ(renderer().pick(100, 80)->id, 1u);
  ASSERT_TRUE(renderer().pick(100, 62));
  EXPECT_EQ(renderer().pick(100, 62)->id, 2u);
}

}  // namespace
}  // namespace isobrick
