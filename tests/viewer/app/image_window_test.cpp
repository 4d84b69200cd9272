#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <set>
#include <string>
#include <string_view>

#include "bricks/image_volumes.h"
#include "core/vectors.h"
#include "tests/viewer/app/window_test.h"

// Images with channels and times; messages about isovalues and the input.

namespace isobrick::inline v0 {
namespace {

constexpr int kEdge = 40;

class ImageWindow : public test::WindowTest {
 protected:
  /// Writes an OME-Zarr 0.4 image of two times and three channels: balls of radius 6 + 3 · channel
  /// + time, 128 on their surface. All samples of the last channel are below 100.
  std::filesystem::path write_image() {
    namespace fs = std::filesystem;
    const fs::path image = dir_ / "image.zarr";
    fs::create_directories(image / "0");
    dir_.write("image.zarr/.zgroup", R"({"zarr_format": 2})");
    dir_.write("image.zarr/.zattrs", R"({"multiscales": [{"version": "0.4", "axes": [
      {"name": "t", "type": "time"}, {"name": "c", "type": "channel"},
      {"name": "z", "type": "space"}, {"name": "y", "type": "space"},
      {"name": "x", "type": "space"}], "datasets": [{"path": "0", "coordinateTransformations": [
      {"type": "scale", "scale": [1, 1, 1, 1, 1]}]}]}],
      "omero": {"channels": [{"label": "nuclei"}, {"label": "walls"}, {"label": "dim"}]}})");
    dir_.write("image.zarr/0/.zarray",
               R"({"zarr_format": 2, "shape": [2, 3, 40, 40, 40], "chunks": [1, 1, 40, 40, 40],
                   "dtype": "|u1", "compressor": null, "filters": null, "fill_value": 0,
                   "order": "C"})");
    for (int time = 0; time < 2; ++time)
      for (int channel = 0; channel < 3; ++channel)
        dir_.write(
            "image.zarr/0/" + std::to_string(time) + '.' + std::to_string(channel) + ".0.0.0",
            ball(6 + 3 * channel + time, channel == 2 ? 0.35 : 1));
    return image;
  }

  static std::string ball(double radius, double factor) {
    std::string samples;
    for (int i = 0; i < kEdge * kEdge * kEdge; ++i) {
      const double away =
          std::hypot(i % kEdge - 20.0, i / kEdge % kEdge - 20.0, i / (kEdge * kEdge) - 20.0);
      samples.push_back(
          static_cast<char>(factor * std::clamp(128 + 8 * (radius - away), 0.0, 255.0)));
    }
    return samples;
  }

  bool has_message(std::string_view text) const {
    const auto& messages = window_->state().messages;
    return std::any_of(messages.begin(), messages.end(), [&](const Message& message) {
      return message.text.find(text) != std::string::npos;
    });
  }
  /// The radius of the surface in the middle of the picture.
  double radius_in_the_middle() {
    steps(3);
    until([&] { return is_still(); });
    const FrameState& state = window_->state().scene_renderer->state();
    EXPECT_GT(state.triangles, 0u);
    const Renderer& renderer = window_->state().scene_renderer->renderer();
    const auto point = renderer.pick(renderer.width() / 2, renderer.height() / 2);
    if (!point) return 0;
    return length(point->position - Vec3d{20, 20, 20});
  }
};

TEST_F(ImageWindow, AnImageThatIsDroppedShowsItsFirstVolumeAndOthersAreChosen) {
  ViewerWindow& window = open();
  const std::filesystem::path image = write_image();
  window.drop(image);
  until([&] { return window.state().path == image; });
  const ViewerState& state = window.state();
  ASSERT_EQ(state.volumes.axes.size(), 2u);
  EXPECT_EQ(state.volumes.selection.channel, 0);
  EXPECT_EQ(state.volumes.selection.time, 0);
  EXPECT_EQ(text_of(state.volumes), "time 0, channel 0");
  EXPECT_TRUE(has_message("the ranges of the samples were computed"));
  window.state().settings.surfaces[0].isovalue = 128;
  EXPECT_NEAR(radius_in_the_middle(), 6, 0.5);

  // Camera and isovalue stay, if the other volume has the isovalue, too.
  window.state().settings.edges = true;
  const Camera camera = state.navigator.camera;
  window.state().requests.volume = Selection{.channel = 1, .time = 1};
  until([&] { return state.volumes.selection.channel == 1; });
  EXPECT_EQ(state.volumes.selection.time, 1);
  EXPECT_EQ(state.settings.surfaces[0].isovalue, 128);
  EXPECT_TRUE(state.settings.edges);
  EXPECT_EQ(state.navigator.camera, camera);
  EXPECT_NEAR(radius_in_the_middle(), 10, 0.5);

  // An isovalue out of its range is replaced.
  window.state().requests.volume = Selection{.channel = 2, .time = 1};
  until([&] { return state.volumes.selection.channel == 2; });
  EXPECT_LT(state.settings.surfaces[0].isovalue, 100);
  EXPECT_GT(radius_in_the_middle(), 5);

  // The first volume has ranges now; a missing volume leaves the present one open.
  window.state().requests.volume = Selection{.channel = 0, .time = 0};
  until([&] { return state.volumes.selection.channel == 0; });
  EXPECT_EQ(state.import, nullptr);
  window.state().requests.volume = Selection{.channel = 7, .time = 0};
  until([&] { return has_message("--channel 7 is not there"); });
  EXPECT_EQ(state.volumes.selection.channel, 0);
}

TEST_F(ImageWindow, RangesThatAreCancelledLeaveTheImageAsItWas) {
  ViewerWindow& window = open();
  const std::filesystem::path image = write_image();
  std::set<std::filesystem::path> before;
  const auto files = [&] {
    std::set<std::filesystem::path> all;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(image))
      if (!entry.is_directory()) all.insert(entry.path());
    return all;
  };
  before = files();
  window.drop(image);
  ASSERT_NE(window.state().import, nullptr);
  window.state().import->cancel();
  until([&] { return window.state().import == nullptr; });
  if (window.state().path != image) {  // else it has finished
    EXPECT_EQ(files(), before);
  }
}

TEST_F(ImageWindow, AChosenVolumeIsOpenedWithoutTheOthers) {
  ViewerWindow& window = open();
  const std::filesystem::path image = write_image();
  EXPECT_TRUE(contains(message_of<Error>([&] { window.open(image, {.channel = 1, .time = {}}); }),
                       "isobrick index"))
      << "ranges are computed where somebody drops it";
  EXPECT_EQ(window.state().path, dir_ / "sphere.zarr");
}

TEST_F(ImageWindow, ATimeOfAFileThatIsDroppedIsItsFirst) {
  ViewerWindow& window = open();
  dir_.write("movie.nrrd",
             "NRRD0004\ntype: uint8\ndimension: 4\nsizes: 40 40 40 2\nencoding: raw\n"
             "kinds: space space space time\n\n" +
                 ball(8, 1) + ball(12, 1));
  window.drop(dir_ / "movie.nrrd");
  until([&] { return window.state().import == nullptr; });
  EXPECT_EQ(window.state().name, "movie.nrrd")
      << (window.state().messages.empty() ? "" : window.state().messages[0].text);
  EXPECT_TRUE(has_message("'movie.nrrd' has several volumes; this is the first"));
  window.state().settings.surfaces[0].isovalue = 128;
  EXPECT_NEAR(radius_in_the_middle(), 8, 0.5);
}

TEST_F(ImageWindow, RemarksOfAReaderAreShown) {
  ViewerWindow& window = open();
  dir_.write("long.nrrd",
             "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 40 40 40\nencoding: raw\n\n" +
                 ball(8, 1) + "more than that");
  window.drop(dir_ / "long.nrrd");
  until([&] { return window.state().name == "long.nrrd"; });
  steps(2);
  EXPECT_TRUE(has_message("14 bytes"));
}

TEST_F(ImageWindow, AnIsovalueThatNoSampleReachesIsSaidWithTheRange) {
  WindowOptions options;
  options.settings.surfaces = {{.isovalue = 900}};
  ViewerWindow& window = open(options);
  const ValueRange<double> range = window.state().isovalue_stats->counts().range();
  const auto text = [&](const std::string& isovalue) {
    return "isovalue " + isovalue + ": the surface is empty; the samples of level 0 lie within " +
           std::to_string(static_cast<int>(range.lo)) + " and " +
           std::to_string(static_cast<int>(range.hi));
  };
  until([&] { return has_message(text("900")); });
  EXPECT_EQ(window.state().messages.size(), 1u);
  // Shown once; never for an isovalue with a surface.
  window.state().messages.clear();
  window.state().settings.surfaces[0].isovalue = 100;
  steps(5);
  window.state().settings.surfaces[0].isovalue = 900;
  steps(5);
  EXPECT_TRUE(window.state().messages.empty());
  window.state().settings.surfaces[0].isovalue = -5;
  until([&] { return has_message(text("-5")); });
}

}  // namespace
}  // namespace isobrick
