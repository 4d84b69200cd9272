#include <algorithm>
#include <cmath>

#include "tests/tools/program.h"
#include "tests/viewer/render/png_picture.h"
#include "viewer/render/gl_context.h"

namespace isobrick::test {
namespace {

using ViewCommand = ProgramTest;

TEST_F(ViewCommand, NamesTheStoreThatIsMissingWithoutADisplay) {
  const Outcome outcome = run_process({"env", "-u", "DISPLAY", "-u", "WAYLAND_DISPLAY",
                                       ISOBRICK_PROGRAM, "view", path("none.zarr")});
  expect_refused(outcome, 1, {"none.zarr", "is no store"});
}

TEST_F(ViewCommand, AFolderThatCannotBeMadeIsNamed) {
  if (!GlContext::available()) GTEST_SKIP() << "no OpenGL 4.5 without a window here";
  write_file(path("file"), "");
  const Outcome outcome =
      run({"view", make_store("a"), "--turntable", path("file/turn"), "--frames", "2"});
  expect_refused(outcome, 1, {"cannot create the folder", "file/turn'", "Not a directory"});
}

/// Pictures that are drawn off-screen.
class ViewPicture : public ProgramTest {
 protected:
  void SetUp() override {
    if (!GlContext::available()) GTEST_SKIP() << "no OpenGL 4.5 without a window here";
  }

  /// A ball of radius 20 around (40, 40, 40) in 160³ samples: 128 on its surface, more inside.
  std::string small_ball() {
    constexpr int n = 160;
    std::string samples;
    for (int z = 0; z < n; ++z)
      for (int y = 0; y < n; ++y)
        for (int x = 0; x < n; ++x) {
          const double away = std::hypot(x - 40.0, y - 40.0, z - 40.0);
          samples.push_back(static_cast<char>(std::clamp(128 + 5 * (20 - away), 0.0, 255.0)));
        }
    write_file(path("ball_160x160x160_uint8.raw"), samples);
    run_json({"convert", path("ball_160x160x160_uint8.raw"), path("ball.zarr"), "--brick", "32"});
    return path("ball.zarr");
  }

  PngPicture view(const std::string& store, const Arguments& more) {
    Arguments all{"view",        store,    "--isovalue", "128",     "--screenshot",
                  path("v.png"), "--size", "300x200",    "--plain", "--force"};
    all.insert(all.end(), more.begin(), more.end());
    last_ = run_json(all);
    return read_png(path("v.png"));
  }

  nlohmann::json last_;
};

struct Rectangle {
  int left, top, right, bottom;
};

Rectangle surface_of(const PngPicture& picture) {
  Rectangle r{picture.width, picture.height, -1, -1};
  for (int y = 0; y < picture.height; ++y)
    for (int x = 0; x < picture.width; ++x) {
      if (!picture.surface(x, y)) continue;
      r = {std::min(r.left, x), std::min(r.top, y), std::max(r.right, x), std::max(r.bottom, y)};
    }
  return r;
}

TEST_F(ViewPicture, FramesTheSurfaceAndNotTheVolume) {
  const std::string store = small_ball();
  const auto expect_framed = [](const PngPicture& picture) {
    const Rectangle ball = surface_of(picture);
    EXPECT_GT(ball.bottom - ball.top, 0.4 * picture.height);
    EXPECT_GT(ball.left, 0);
    EXPECT_GT(ball.top, 0);
    EXPECT_LT(ball.right, picture.width - 1);
    EXPECT_LT(ball.bottom, picture.height - 1);
  };
  expect_framed(view(store, {}));
  expect_framed(view(store, {"--camera", "azimuth=-70,elevation=60,orthographic"}));
  run_json({"view", store, "--isovalue", "128", "--turntable", path("turn"), "--frames", "3",
            "--size", "300x200", "--plain"});
  for (const char* name : {"turn/0000.png", "turn/0001.png", "turn/0002.png"})
    expect_framed(read_png(path(name)));
  // A slice is framed, too; if nothing is visible, the volume is framed.
  const Rectangle with_slice = surface_of(view(store, {"--slice", "z:0.9"}));
  EXPECT_LT(with_slice.bottom - with_slice.top, 100);
  EXPECT_EQ(
      run({"view", store, "--isovalue", "255", "--screenshot", path("none.png"), "--size", "64x64"})
          .exit_code,
      0);
}

TEST_F(ViewPicture, AStoreInAZipLooksTheSame) {
  if (!available("zip")) GTEST_SKIP() << "no zip";
  const std::string store = small_ball();
  ASSERT_EQ(
      run_process({"sh", "-c", "cd \"$0\" && zip -q -0 -r ../ball.zarr.zip .", store}).exit_code,
      0);
  EXPECT_TRUE(view(store, {}).rgb == view(path("ball.zarr.zip"), {}).rgb);
}

TEST_F(ViewPicture, AnEyeOfItsOwnIsWhereItIs) {
  const std::string store = small_ball();
  const Arguments eye{"--camera", "eye=80:-300:80,target=80:80:80"};
  const PngPicture one = view(store, eye);
  const Rectangle ball = surface_of(one);
  EXPECT_LT(ball.right - ball.left, 60);
  EXPECT_LT(ball.right, 150) << "left of the middle";
  EXPECT_GT(ball.top, 100) << "below it";
}

TEST_F(ViewPicture, ShowsNoFinerLevelThanTheOneThatIsChosen) {
  const std::string store = small_ball();
  const auto triangles = [&](const Arguments& more) {
    Arguments all{"--pixel-error", "0.1"};
    all.insert(all.end(), more.begin(), more.end());
    view(store, all);
    return last_["most_triangles"].get<double>();
  };
  const double finest = triangles({}), second = triangles({"--level", "1"}),
               third = triangles({"--level", "2"});
  EXPECT_EQ(last_["level"], 2);
  EXPECT_EQ(triangles({"--level", "0"}), finest);
  // Cells of twice the length: about a quarter of the triangles.
  EXPECT_NEAR(second / finest, 0.25, 0.1);
  EXPECT_NEAR(third / second, 0.25, 0.12);
  const Outcome none = run({"view", store, "--level", "4", "--screenshot", path("w.png")});
  expect_refused(none, 2, {"no level 4", "0 to 3"});
}

TEST_F(ViewPicture, ARegionCountsTheSamplesOfTheLevel) {
  const std::string store = small_ball();
  const auto half = [&](const char* level, const char* roi) {
    return view(store, {"--level", level, "--roi", roi, "--no-occlusion", "--camera",
                        "eye=40:-200:40,target=40:40:40"});
  };
  // Sample 20 of level 1 is at 40.5: half of the ball.
  for (const PngPicture& picture : {half("0", "0:41,:,:"), half("1", "0:21,:,:")}) {
    const Rectangle ball = surface_of(picture);
    EXPECT_NEAR(ball.right, 150, 3);
    EXPECT_LT(ball.left, 140);
  }
  const Rectangle whole = surface_of(half("1", "0:80,:,:"));
  EXPECT_NEAR(whole.left + whole.right, 299, 4);
  const Outcome beyond =
      run({"view", store, "--level", "1", "--roi", "0:81,:,:", "--screenshot", path("w.png")});
  expect_refused(beyond, 2, {"81"});
}

/// A clipped ball shows its inside darker, unless `inside` makes that its outside.
TEST_F(ViewPicture, InsideSaysWhichSideIsTheOuterOne) {
  const std::string store = small_ball();
  const auto brightness = [&](const Arguments& more) {
    Arguments all{"--clip", "0,1,0,40", "--no-occlusion", "--camera", "azimuth=0,elevation=0"};
    all.insert(all.end(), more.begin(), more.end());
    const PngPicture picture = view(store, all);
    EXPECT_TRUE(picture.surface(150, 100));
    return picture.brightness(150, 100);
  };
  const int usual = brightness({}), above = brightness({"--inside", "above"}),
            below = brightness({"--inside", "below"});
  EXPECT_EQ(usual, above);
  EXPECT_GT(below, above + 30);
  expect_refused(run({"view", store, "--inside", "in", "--screenshot", path("w.png")}), 2,
                 {"'in'", "above or below"});
}

TEST_F(ViewCommand, SaysThatAPictureIsCoarserThanAskedFor) {
  if (!GlContext::available()) GTEST_SKIP() << "no OpenGL 4.5 without a window here";
  run_json({"synth", "gyroid", path("g.zarr"), "--dims", "192,192,192", "--type", "u8"});
  const auto view = [&](const std::string& memory) {
    return run({"view", path("g.zarr"), "--screenshot", path("g.png"), "--size", "400x300",
                "--pixel-error", "0.5", "--memory", memory, "--force", "--no-occlusion"});
  };
  const Outcome coarse = view("210M"), fine = view("1G");
  EXPECT_EQ(coarse.exit_code, 0) << coarse.err;
  EXPECT_NE(coarse.err.find("--memory"), std::string::npos) << coarse.err;
  EXPECT_EQ(fine.exit_code, 0) << fine.err;
  EXPECT_EQ(fine.err.find("--memory"), std::string::npos) << fine.err;
}

}  // namespace
}  // namespace isobrick::test
