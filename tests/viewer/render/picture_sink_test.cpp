#include "viewer/render/picture_sink.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>

#include <isobrick/error.h>
#include "tests/io/bytes/temp_dir.h"
#include "tests/io/meshes/test_meshes.h"

namespace isobrick::inline v0 {
namespace {

constexpr int kWidth = 200, kHeight = 160;

PictureSinkOptions on_white() {
  PictureSinkOptions options{.width = kWidth, .height = kHeight};
  options.settings.background_top = options.settings.background_bottom = {1, 1, 1};
  return options;
}

void add_ball(PictureSink& sink, float radius, const MeshStyle& style,
              const std::string& unit = "") {
  const TestMesh ball = make_ball({0, 0, 0}, radius, 60);
  const double r = radius;
  sink.set_style(style);
  sink.begin({true, {-r, -r, -r}, {r, r, r}, {}, unit});
  sink.write(ball.chunk());
  sink.finish();
}

using Pixels = std::vector<std::uint8_t>;

const std::uint8_t* pixel(const Pixels& rgba, int x, int y) {
  return rgba.data() + 4 * (y * kWidth + x);
}

/// Columns of the middle row that are not white.
int covered(const Pixels& rgba) {
  int count = 0;
  for (int x = 0; x < kWidth; ++x)
    count += *std::min_element(pixel(rgba, x, kHeight / 2), pixel(rgba, x, kHeight / 2) + 3) < 250;
  return count;
}

TEST(PictureSink, TheFirstMeshFillsThePictureUnlessAFrameIsGiven) {
  PictureSink plain(on_white());
  add_ball(plain, 1, {});
  const int across = covered(plain.end());
  EXPECT_GT(across, 80);
  PictureSinkOptions options = on_white();
  options.frame = MeshBounds{{-2, -2, -2}, {2, 2, 2}};
  PictureSink framed(options);
  add_ball(framed, 1, {});
  EXPECT_NEAR(covered(framed.end()), across / 2, 4);
}

TEST(PictureSink, OpaqueMeshesShowThroughTransparentOnes) {
  PictureSinkOptions options = on_white();
  options.frame = MeshBounds{{-2, -2, -2}, {2, 2, 2}};
  PictureSink sink(options);
  add_ball(sink, 1, {.colour = {1, 0, 0}});
  const std::uint64_t opaque = sink.memory();
  add_ball(sink, 2, {.colour = {0, 0, 1}, .opacity = 0.3f});
  EXPECT_GT(sink.memory(), opaque);
  const Pixels rgba = sink.end();
  const std::uint8_t* middle = pixel(rgba, kWidth / 2, kHeight / 2);
  EXPECT_GT(middle[0], middle[2] + 20);
  const std::uint8_t* beside = pixel(rgba, kWidth / 2 + 45, kHeight / 2);
  EXPECT_GT(beside[2], beside[0] + 10);
}

TEST(PictureSink, MeshesInOtherUnitsAreScaled) {
  PictureSinkOptions options = on_white();
  options.frame = MeshBounds{{-2, -2, -2}, {2, 2, 2}};
  PictureSink one(options);
  add_ball(one, 2, {}, "millimeter");
  const int across = covered(one.end());
  PictureSink other(options);
  add_ball(other, 0.1f, {}, "millimeter");
  add_ball(other, 0.2f, {}, "centimeter");
  EXPECT_NEAR(covered(other.end()), across, 2);
}

TEST(PictureSink, OverlaysNeedAUnitThatIsKnown) {
  PictureSinkOptions options = on_white();
  options.box = options.axes = options.scale_bar = true;
  PictureSink plain(options);
  add_ball(plain, 1, {});
  EXPECT_FALSE(plain.end().empty());
  options.scale_bar_unit = "millimeter";
  PictureSink sink(options);
  add_ball(sink, 1, {});
  EXPECT_THROW(sink.end(), UsageError);
}

TEST(PictureSink, IsABackgroundWithoutMeshes) {
  PictureSink sink(on_white());
  const Pixels rgba = sink.end();
  EXPECT_EQ(rgba.size(), std::size_t{4} * kWidth * kHeight);
  EXPECT_EQ(covered(rgba), 0);
  EXPECT_THROW(sink.end(), Error);
}

TEST(PictureSink, AStopEndsIt) {
  std::stop_source stop;
  stop.request_stop();
  PictureSinkOptions options = on_white();
  options.width = options.height = 2000;
  PictureSink sink(options);
  add_ball(sink, 1, {});
  EXPECT_THROW(sink.end(stop.get_token()), Cancelled);
}

}  // namespace
}  // namespace isobrick
