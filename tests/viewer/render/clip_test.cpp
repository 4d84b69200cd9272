#include <gtest/gtest.h>

#include <cstdint>
#include <cstdlib>
#include <optional>
#include <vector>

#include "tests/io/meshes/test_meshes.h"
#include "tests/viewer/render/pictures.h"

namespace isobrick::inline v0 {
namespace {

constexpr int kWidth = 200, kHeight = 160;

/// Meshes that are clipped and meshes that are not use different shader programs.
class Clipping : public RenderTest {
 protected:
  void SetUp() override {
    RenderTest::SetUp();
    if (IsSkipped()) return;
    pool_.emplace(20'000);
    pooled_ = pool_->add(make_ball({0.3f, 0, 0.2f}, 0.6f, 40).chunk());
  }
  void TearDown() override {
    pooled_ = {};
    pool_.reset();
    RenderTest::TearDown();
  }

  /// Everything that can be clipped: meshes in a pool and in memory, opaque and transparent,
  /// slices.
  void draw_all(Renderer& renderer, const PictureSettings& settings) {
    Camera camera({0.4, -1, 0.3}, {0, 0, 0}, {0, 0, 1});
    camera.fit({-1, -1, -1}, {1, 1, 1}, double{kWidth} / kHeight);
    renderer.begin(camera, kWidth, kHeight, settings);
    renderer.draw(pooled_, style({0.8f, 0.8f, 0.6f}, 1, 1));
    renderer.draw(pooled_, style({0.2f, 0.5f, 0.9f}, 0.3f, 2));
    renderer.draw(ball_.chunk(), style({0.9f, 0.3f, 0.2f}, 1, 3));
    renderer.draw(ball_.chunk(), style({0.4f, 0.9f, 0.2f}, 0.5f, 4), {0.2, -0.5, 0.3});
    SliceImage slice{.corner = {-1, 0.1, -1},
                     .along_x = {2, 0, 0},
                     .along_y = {0, 0, 2},
                     .width = 2,
                     .height = 2,
                     .samples = samples_};
    renderer.draw(slice);
    slice.corner.y = -0.4;
    slice.opacity = 0.3f;
    renderer.draw(slice);
    renderer.end();
  }

  MeshStyle style(Vec3f colour, float opacity, std::uint32_t id) const {
    MeshStyle style{.colour = colour, .opacity = opacity, .id = id, .clip_mask = clip_mask_};
    if (one_tone_) style.inside = colour;
    return style;
  }

  bool one_tone_ = false;  ///< back faces have the colour of front faces
  std::uint16_t clip_mask_ = MeshStyle{}.clip_mask;
  std::optional<MeshPool> pool_;
  PooledMesh pooled_;
  TestMesh ball_ = make_ball({-0.4f, 0.1f, -0.2f}, 0.5f, 30);
  std::vector<float> samples_{0, 0.4f, 0.7f, 1};
};

/// No clipping; a plane; a region; several planes.
std::vector<PictureSettings> clip_settings() {
  PictureSettings whole{.picking = true}, plane = whole, region = whole, many = whole;
  plane.planes = {{{0.3, 1, 0.1}, -0.2}};
  region.region = WorldBox{{-0.6, -0.3, -0.7}, {0.5, 0.9, 0.4}};
  many.region = region.region;
  many.planes = {
      {{0.3, 1, 0.1}, -0.2}, {{-1, 0, 0}, -0.4}, {{0, 0, 1}, -0.5}, {{0, -1, 0.2}, -0.8}};
  return {whole, plane, region, many};
}

struct Picture {
  std::vector<std::uint8_t> pixels;
  std::vector<std::uint32_t> ids;  ///< 99: nothing
  bool operator==(const Picture&) const = default;
};

Picture read(const Renderer& renderer) {
  Picture picture{renderer.read_pixels(), {}};
  for (int y = 0; y < kHeight; y += 4)
    for (int x = 0; x < kWidth; x += 4) {
      const std::optional<PickResult> picked = renderer.pick(x, y);
      picture.ids.push_back(picked ? picked->id : 99);
    }
  return picture;
}

TEST_F(Clipping, EarlierClippingChangesNothing) {
  const std::vector<PictureSettings> settings = clip_settings();
  std::vector<Picture> expected;
  for (const PictureSettings& clip : settings) {
    Renderer fresh;
    draw_all(fresh, clip);
    expected.push_back(read(fresh));
    for (std::size_t other = 0; other + 1 < expected.size(); ++other)
      EXPECT_NE(expected.back().pixels, expected[other].pixels) << other;
  }
  for (std::size_t before = 0; before < settings.size(); ++before)
    for (std::size_t after = 0; after < settings.size(); ++after) {
      draw_all(renderer(), settings[before]);
      draw_all(renderer(), settings[after]);
      EXPECT_TRUE(read(renderer()) == expected[after]) << after << " after " << before;
    }
}

TEST_F(Clipping, PreparingChangesNothing) {
  for (const PictureSettings& clip : clip_settings()) {
    Renderer fresh;
    draw_all(fresh, clip);
    for (const int width : {16, kWidth}) {
      renderer().prepare(clip, width, kHeight);
      EXPECT_FALSE(renderer().has_picture());
      draw_all(renderer(), clip);
      EXPECT_TRUE(read(renderer()) == read(fresh));
    }
  }
}

/// Pixels that differ by more than the rounding of two shader programs.
int pixels_apart(const Picture& a, const Picture& b) {
  int apart = 0;
  for (std::size_t i = 0; i < a.pixels.size(); ++i)
    apart += std::abs(int{a.pixels[i]} - int{b.pixels[i]}) > 4;
  return apart;
}

/// The lower left part of a square that is seen at an angle; `right` and `top`: its size, 0 … 1.
TestMesh leaning_square(float right, float top) {
  TestMesh mesh;
  const Vec3f corner{-0.8f, -0.6f, -0.7f}, along_x{1.5f, 1.1f, 0.1f}, along_y{0.2f, 0.4f, 1.4f};
  const auto at = [&](float x, float y) { return corner + along_x * x + along_y * y; };
  mesh.positions = {at(0, 0), at(right, 0), at(0, top), at(right, top)};
  mesh.normals.assign(4, Vec3f{0.6f, -0.8f, 0});
  mesh.triangles = {{0, 1, 2}, {1, 3, 2}};
  return mesh;
}

/// A clipped edge is antialiased as a triangle's edge is, and accurate to a fraction of a pixel.
TEST_F(Clipping, ClippedEdgesEqualThoseOfAMeshThatEndsThere) {
  const TestMesh all = leaning_square(1, 1), part = leaning_square(0.55f, 0.35f);
  // Planes through the edges of `part`, along the normal of the square.
  const auto vec = [](Vec3f v) { return Vec3d{v.x, v.y, v.z}; };
  const Vec3d p = vec(part.positions[3]), across = vec(part.positions[2]) - p,
              down = vec(part.positions[1]) - p, normal = cross(across, down);
  const auto inward = [&](Vec3d edge, Vec3d to) {
    const Vec3d n = cross(edge, normal);
    return half_space_at(p, dot(n, to) > 0 ? n : n * -1.0);
  };
  for (const bool orthographic : {false, true})
    for (const bool multisample : {false, true}) {
      PictureSettings settings{.multisample = multisample, .occlusion = false, .picking = true};
      Camera camera({0.9, -1, 0.4}, {0, 0, 0}, {0, 0, 1});
      camera.fit({-1, -1, -1}, {1, 1, 1}, double{kWidth} / kHeight);
      camera.orthographic = orthographic;
      const auto picture = [&](const TestMesh& mesh) {
        renderer().begin(camera, kWidth, kHeight, settings);
        renderer().draw(mesh.chunk(), {.id = 5}, {});
        renderer().end();
        return read(renderer());
      };
      const Picture expected = picture(part), whole = picture(all);
      settings.planes = {inward(down, across), inward(across, down)};
      const Picture clipped = picture(all);
      EXPECT_GT(pixels_apart(whole, expected), 1000);
      // A sample may lie on the edge itself.
      EXPECT_LT(pixels_apart(clipped, expected), 8) << orthographic << multisample;
      EXPECT_EQ(clipped.ids, expected.ids);
    }
}

/// Slices have no mask: every half space clips them.
TEST_F(Clipping, HalfSpacesOutsideTheMaskAreIgnored) {
  PictureSettings settings{.picking = true, .in_order = false};
  // The first plane clips something; the others clip nothing that is drawn.
  settings.planes = {{{0.3, 1, 0.1}, -0.2}, {{-1, 0, 0}, -9}};
  settings.region = WorldBox{{-7, -7, -7}, {7, 7, 7}};
  for (const std::size_t planes : {2u, 3u}) {
    settings.planes.resize(planes, {{0, 0, 1}, -9});
    draw_all(renderer(), settings);
    const Picture expected = read(renderer());
    for (const int mask : {0b1, 0b1001, 0b1111, 0b11111, 0b101010101}) {
      clip_mask_ = static_cast<std::uint16_t>(mask);
      draw_all(renderer(), settings);
      const Picture few = read(renderer());
      EXPECT_EQ(few.ids, expected.ids) << mask;
      EXPECT_LT(pixels_apart(few, expected), 60) << mask;
    }
    clip_mask_ = 0;
    draw_all(renderer(), settings);
    EXPECT_NE(read(renderer()).ids, expected.ids);
    clip_mask_ = 0b10;
    draw_all(renderer(), settings);
    EXPECT_NE(read(renderer()).ids, expected.ids);
    clip_mask_ = MeshStyle{}.clip_mask;
  }
}

TEST_F(Clipping, PlanesThatClipNothingChangeNothing) {
  one_tone_ = true;
  PictureSettings settings{.picking = true};
  draw_all(renderer(), settings);
  const Picture whole = read(renderer());
  settings.planes = {{{0.3, 1, 0.1}, -9}, {{-1, 0, 0}, -9}};
  settings.region = WorldBox{{-7, -7, -7}, {7, 7, 7}};
  // With few planes and with many.
  for (const std::size_t planes : {1u, 3u}) {
    settings.planes.resize(planes, {{0, 0, 1}, -9});
    draw_all(renderer(), settings);
    const Picture clipped = read(renderer());
    EXPECT_EQ(clipped.ids, whole.ids);
    EXPECT_LT(pixels_apart(clipped, whole), 60) << planes;
  }
}

}  // namespace
}  // namespace isobrick
