#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <string>

#include "tests/pipeline/drop_histogram.h"
#include "tests/viewer/app/window_test.h"
#include "viewer/app/viewer_window.h"

// What a window opens, and what it shows where that is damaged or no volume.

namespace isobrick::inline v0 {
namespace {

using Window = test::WindowTest;

TEST_F(Window, SaysWhatIsDamaged) {
  ViewerWindow& window = open();
  make_store("damaged.zarr", {96, 96, 96});
  for (const auto& entry : std::filesystem::recursive_directory_iterator(dir_ / "damaged.zarr/0")) {
    if (!entry.is_regular_file() || entry.path().extension() == ".json") continue;
    std::fstream file(entry.path(), std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(static_cast<std::streamoff>(entry.file_size() / 3));
    file.write("damage", 6);
  }
  test::drop_histogram(dir_ / "damaged.zarr");
  window.open(dir_ / "damaged.zarr");
  until([&] { return is_still(); });
  steps(3);
  ASSERT_FALSE(window.state().scene_renderer->state().damage.empty());
  const auto has_message = [&](const std::string& text) {
    return std::any_of(window.state().messages.begin(), window.state().messages.end(),
                       [&](const Message& message) { return message.text.find(text) == 0; });
  };
  EXPECT_TRUE(has_message(window.state().scene_renderer->state().damage[0]));
  until([&] {
    return has_message("the histogram lacks bricks that cannot be read, 1 of level 0: ");
  });
  EXPECT_NE(window.state().isovalue_stats->histogram(), nullptr);
  const std::size_t shown = window.state().messages.size();
  window.state().messages.clear();
  window.state().settings.edges = true;
  steps(5);
  EXPECT_TRUE(window.state().messages.empty()) << "shown once";
  EXPECT_LE(shown, 5u);
}

TEST_F(Window, OpensWhatIsDroppedOnIt) {
  ViewerWindow& window = open();
  make_store("other.zarr", {40, 40, 40});
  window.drop(dir_ / "other.zarr");
  EXPECT_EQ(window.state().path, dir_ / "other.zarr");
  std::string samples(64 * 64 * 64, '\0');
  for (std::size_t i = 0; i < samples.size(); ++i) samples[i] = static_cast<char>(i / 4096);
  dir_.write("ramp_64x64x64_uint8.raw", samples);
  window.drop(dir_ / "ramp_64x64x64_uint8.raw");
  until([&] { return window.state().name == "ramp_64x64x64_uint8.raw"; });
  ASSERT_EQ(window.state().messages.size(), 1u);
  EXPECT_NE(window.state().messages[0].text.find("into the cache ('" + (dir_ / "cache")),
            std::string::npos);
  window.drop(dir_ / "other.zarr");
  EXPECT_EQ(window.state().path, dir_ / "other.zarr");
  window.drop(dir_ / "ramp_64x64x64_uint8.raw");
  until([&] { return window.state().name == "ramp_64x64x64_uint8.raw"; });
  EXPECT_EQ(window.state().messages.size(), 1u) << "the store was kept";
}

TEST_F(Window, ShowsWhatIsWrongAndGoesOn) {
  ViewerWindow& window = open();
  window.drop(dir_ / "nothing.zarr");
  dir_.write("nonsense.nrrd", "NRRD0004\ntype: what\n");
  window.drop(dir_ / "nonsense.nrrd");
  until([&] { return window.state().import == nullptr; });
  EXPECT_GE(window.state().messages.size(), 1u);
  EXPECT_EQ(window.state().path, dir_ / "sphere.zarr");
  EXPECT_TRUE(window.step(0));
}

TEST_F(Window, MessagesMayComeWithAConversion) {
  ViewerWindow& window = open();
  dir_.write("a_1024x1024x1024_uint8.raw", "");
  std::filesystem::resize_file(dir_ / "a_1024x1024x1024_uint8.raw", std::uintmax_t{1} << 30);
  window.drop(dir_ / "a_1024x1024x1024_uint8.raw");
  window.drop(dir_ / "b_1024x1024x1024_uint8.raw");  // is refused meanwhile
  ASSERT_NE(window.state().import, nullptr);
  ASSERT_EQ(window.state().messages.size(), 1u);
  steps(3);
  ASSERT_NE(window.state().import, nullptr);
  window.state().messages.clear();
  window.state().import->cancel();
  until([&] { return window.state().import == nullptr; });
  steps(3);
  window.state().show_message("some time after the conversion");
  steps(3);
}

}  // namespace
}  // namespace isobrick
