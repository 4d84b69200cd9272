#include "viewer/render/preview_sink.h"

#include <epoxy/egl.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <limits>

#include "io/bytes/png_file.h"
#include "tests/io/bytes/temp_dir.h"
#include "tests/io/meshes/test_meshes.h"
#include "tests/viewer/render/png_picture.h"

namespace isobrick::inline v0 {
namespace {

using Picture = test::PngPicture;

PreviewOptions small() {
  PreviewOptions options;
  options.width = 200;
  options.height = 160;
  return options;
}

Picture draw(const std::vector<MeshChunk>& chunks, const PreviewOptions& options = small(),
             const MeshHeader& header = {true, {-1, -1, -1}, {1, 1, 1}}) {
  const TempDir dir;
  PreviewSink sink(dir / "a.png", false, options);
  EXPECT_EQ(sink.indexing(), Indexing::chunk_local);
  sink.begin(header);
  for (const MeshChunk& chunk : chunks) sink.write(chunk);
  sink.finish();
  EXPECT_EQ(dir.list(), std::vector<std::string>{"a.png"});
  return test::read_png(dir / "a.png");
}

TEST(PreviewSink, ABallIsARoundSpotInTheMiddle) {
  const TestMesh ball = make_ball({0, 0, 0}, 1, 100);
  const Picture picture = draw({ball.chunk()});
  ASSERT_EQ(picture.width, 200);
  ASSERT_EQ(picture.height, 160);
  int left = 200, right = 0, top = 160, bottom = 0, area = 0;
  for (int y = 0; y < 160; ++y)
    for (int x = 0; x < 200; ++x)
      if (picture.surface(x, y)) {
        left = std::min(left, x), right = std::max(right, x);
        top = std::min(top, y), bottom = std::max(bottom, y);
        ++area;
      }
  EXPECT_NEAR((left + right) / 2.0, 99.5, 1.5);
  EXPECT_NEAR((top + bottom) / 2.0, 79.5, 1.5);
  const double across = right - left + 1, down = bottom - top + 1;
  EXPECT_NEAR(across, down, 3);
  EXPECT_GT(down, 60);
  EXPECT_LT(down, 150);
  // No hole: as many pixels as in a disc.
  EXPECT_NEAR(area, 3.14159 / 4 * across * down, 0.03 * area);
}

TEST(PreviewSink, LightComesFromAboveAndLeft) {
  const TestMesh ball = make_ball({0, 0, 0}, 1, 100);
  const Picture picture = draw({ball.chunk()});
  EXPECT_GT(picture.brightness(90, 65), picture.brightness(112, 98) + 60);
  EXPECT_GT(picture.brightness(0, 0), picture.brightness(0, 159));
}

TEST(PreviewSink, TheNearestIsSeenWhateverTheOrder) {
  const TestMesh ball = make_ball({0, 0, 0}, 1, 60);
  // A back face between the eye and the ball hides the ball and is lit.
  const TestMesh front = make_ball({0.5f, -0.9f, 0.45f}, 0.2f, 30);
  const Picture one = draw({ball.chunk(), front.chunk()});
  const Picture other = draw({front.chunk(), ball.chunk()});
  int apart = 0, most = 0;
  for (std::size_t i = 0; i < one.rgb.size(); ++i) {
    const int difference = std::abs(one.rgb[i] - other.rgb[i]);
    apart += difference > 0;
    most = std::max(most, difference);
  }
  // At equal depth the first one is visible.
  EXPECT_LE(apart, 30);
  EXPECT_LE(most, 60);
  EXPECT_NE(one.rgb, draw({ball.chunk()}).rgb);
}

/// Also for a mesh of several batches, which is framed by the header's bounds.
TEST(PreviewSink, HowAMeshIsDividedNeverShows) {
  const MeshHeader header{.has_normals = true,
                          .world_lo = {-1, -1, -1},
                          .world_hi = {1, 1, 1},
                          .surface = MeshBounds{{-0.9, -0.8, -0.7}, {0.6, 0.7, 0.8}}};
  for (const std::uint32_t rings : {100u, 200u}) {  // 40,000 and 160,000 triangles
    const TestMesh ball = make_ball({0.1f, 0.2f, 0}, 0.3f, rings);
    const Picture whole = draw({ball.chunk()}, small(), header);
    for (const std::size_t piece : {std::size_t{30011}, std::size_t{140000}}) {
      std::vector<MeshChunk> pieces;
      for (std::size_t first = 0; first < ball.triangles.size(); first += piece) {
        MeshChunk chunk = ball.chunk();
        chunk.triangles =
            chunk.triangles.subspan(first, std::min(piece, ball.triangles.size() - first));
        pieces.push_back(chunk);
      }
      EXPECT_EQ(draw(pieces, small(), header).rgb, whole.rgb) << rings << " rings, " << piece;
    }
  }
}

TEST(PreviewSink, BothSidesAreLitAlike) {
  TestMesh ball = make_ball({0, 0, 0}, 1, 60);
  const Picture outside = draw({ball.chunk()});
  for (Vec3f& n : ball.normals) n = n * -1.0f;
  for (Triangle& t : ball.triangles) std::swap(t[0], t[1]);
  const Picture inside = draw({ball.chunk()});
  for (int y = 0; y < outside.height; ++y)
    for (int x = 0; x < outside.width; ++x)
      EXPECT_NEAR(outside.brightness(x, y), inside.brightness(x, y), 12);
}

TEST(PreviewSink, FacetsWithoutNormals) {
  const TestMesh ball = make_ball({0, 0, 0}, 1, 100);
  const Picture smooth = draw({ball.chunk()}),
                facets = draw({ball.chunk(0, false)}, small(), {false, {-1, -1, -1}, {1, 1, 1}});
  EXPECT_TRUE(facets.surface(100, 80));
  EXPECT_NEAR(smooth.brightness(100, 80), facets.brightness(100, 80), 30);
}

TEST(PreviewSink, ViewAndColourCanBeChosen) {
  PreviewOptions options = small();
  options.camera.from = Vec3d{0, 0, 1};  // along `up`
  options.colour = {0.2f, 0.3f, 0.9f};
  const TestMesh ball = make_ball({0, 0, 0.9f}, 0.1f, 20);
  const Picture picture = draw({ball.chunk()}, options);
  EXPECT_GT(picture.at(100, 80)[2], picture.at(100, 80)[0] + 50);
}

TEST(PreviewSink, UpIsUpAndRightIsRight) {
  PreviewOptions options = small();
  options.camera.from = Vec3d{0, -1, 0};
  const TestMesh up = make_ball({0, 0, 0.8f}, 0.2f, 20), right = make_ball({0.8f, 0, 0}, 0.2f, 20);
  const TestMesh down = make_ball({0, 0, -0.98f}, 0.02f, 20),
                 left = make_ball({-0.98f, 0, 0}, 0.02f, 20);
  const Picture upright = draw({up.chunk(), down.chunk()}, options),
                lying = draw({right.chunk(), left.chunk()}, options);
  EXPECT_TRUE(upright.surface(100, 80 - 45));
  EXPECT_FALSE(upright.surface(100, 80 + 45));
  EXPECT_TRUE(lying.surface(100 + 70, 80));
  EXPECT_FALSE(lying.surface(100 - 70, 80));
}

/// Width and height of the surface in pixels.
std::pair<int, int> spot(const Picture& picture) {
  int left = picture.width, right = -1, top = picture.height, bottom = -1;
  for (int y = 0; y < picture.height; ++y)
    for (int x = 0; x < picture.width; ++x)
      if (picture.surface(x, y)) {
        left = std::min(left, x), right = std::max(right, x);
        top = std::min(top, y), bottom = std::max(bottom, y);
      }
  return {right - left + 1, bottom - top + 1};
}

TEST(PreviewSink, FramesTheMeshAndNotTheVolume) {
  const MeshHeader volume{true, {-1, -1, -1}, {1, 1, 1}};
  const auto [across, down] = spot(draw({make_ball({0, 0, 0}, 1, 100).chunk()}));
  for (const float radius : {0.1f, 0.01f}) {
    const TestMesh ball = make_ball({0.7f, -0.5f, 0.2f}, radius, 100);
    const auto [w, h] = spot(draw({ball.chunk()}, small(), volume));
    EXPECT_NEAR(w, across, 2);
    EXPECT_NEAR(h, down, 2);
  }
}

/// The first triangles of a large mesh are drawn before the last ones arrive.
TEST(PreviewSink, FramesALargeMeshByWhatItPassesThrough) {
  MeshHeader header{true, {-1, -1, -1}, {1, 1, 1}};
  const TestMesh ball = make_ball({0.5f, 0.5f, 0.5f}, 0.1f, 300);
  ASSERT_GT(ball.triangles.size(), 1u << 17);
  const auto [small_across, small_down] = spot(draw({ball.chunk(), ball.chunk()}, small(), header));
  header.surface = MeshBounds{{0.4, 0.4, 0.4}, {0.6, 0.6, 0.6}};
  const auto [across, down] = spot(draw({ball.chunk(), ball.chunk()}, small(), header));
  EXPECT_LT(small_down, 20);
  EXPECT_GT(down, 80);
  EXPECT_NEAR(across, down, 3);
}

TEST(PreviewSink, SurvivesBadNumbers) {
  TestMesh mesh = make_ball({0, 0, 0}, 1, 20);
  constexpr float inf = std::numeric_limits<float>::infinity();
  const float nan = std::numeric_limits<float>::quiet_NaN();
  mesh.positions[3] = {nan, 0, 0};
  mesh.positions[60] = {inf, -inf, 0};
  mesh.positions[100] = {1e30f, -1e30f, 1e30f};
  mesh.positions[140] = {0.55f * 1e3f, -1e3f, 0.5f * 1e3f};  // behind the eye
  mesh.normals[200] = {nan, nan, nan};
  mesh.normals[300] = {0, 0, 0};
  EXPECT_TRUE(draw({mesh.chunk()}).surface(100, 80));
  EXPECT_FALSE(draw({}).surface(100, 80));
}

/// Destroys a sink that has drawn, while no context can be made current. Returns the files left.
std::size_t destroy_without_context() {
  const TempDir dir;
  const TestMesh ball = make_ball({0, 0, 0}, 1, 20);
  {
    PreviewSink sink(dir / "a.png", false, small());
    sink.begin({true, {-1, -1, -1}, {1, 1, 1}});
    sink.write(ball.chunk());
    sink.write(ball.chunk(0, false));  // a batch without normals, so that the first one is drawn
    eglMakeCurrent = [](EGLDisplay, EGLSurface, EGLSurface, EGLContext) -> EGLBoolean {
      return EGL_FALSE;
    };
  }
  return dir.list().size();
}

TEST(PreviewSink, IsDestroyedWithoutItsContext) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");  // the driver has threads
  EXPECT_EXIT(std::_Exit(static_cast<int>(destroy_without_context())), testing::ExitedWithCode(0),
              "");
}

TEST(PreviewSink, SizesAreChecked) {
  const TempDir dir;
  PreviewOptions options;
  for (const int width : {0, -1, 15, 20000}) {
    options.width = width;
    message_of([&] { PreviewSink(dir / "a.png", false, options); });
  }
  EXPECT_TRUE(dir.list().empty());
}

TEST(Png, RoundTrip) {
  const TempDir dir;
  std::vector<std::uint8_t> rgb;
  for (int i = 0; i < 3 * 5 * 7; ++i) rgb.push_back(static_cast<std::uint8_t>(i * 37));
  write_png(dir / "a.png", 5, 7, rgb, false);
  const Picture picture = test::read_png(dir / "a.png");
  EXPECT_EQ(picture.width, 5);
  EXPECT_EQ(picture.rgb, rgb);
  message_of([&] { write_png(dir / "a.png", 5, 7, rgb, false); });
  message_of<Error>([&] { write_png(dir / "b.png", 5, 8, rgb, false); });
  EXPECT_EQ(dir.list(), std::vector<std::string>{"a.png"});
}

}  // namespace
}  // namespace isobrick
