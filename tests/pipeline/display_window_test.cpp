#include "pipeline/convert/display_window.h"

#include <gtest/gtest.h>

#include <limits>

#include "tests/pipeline/convert_store.h"

namespace isobrick::test {
namespace {

/// The window that a converted volume gets.
template <class T>
std::optional<DisplayWindow> window_of(Int3 extent, const std::vector<T>& samples,
                                       const ConvertOptions& options = {.brick = 16}) {
  TemporaryFolder folder;
  MemorySource source(extent, scalar_type_of<T>, as_bytes(samples));
  convert_quietly(source, folder / "a", options);
  const std::string text = content_of(folder / "a/zarr.json");
  const auto window = display_window(StoreReader(folder / "a"));
  EXPECT_EQ(text.find("\"omero\"") != std::string::npos, window.has_value());
  const std::string end = std::to_string(window ? window->end : 0).substr(0, 3);
  EXPECT_EQ(text.find("\"end\": " + end) != std::string::npos, window.has_value());
  return window;
}

std::vector<float> ramp(Index count) {
  std::vector<float> samples(static_cast<std::size_t>(count));
  for (std::size_t i = 0; i < samples.size(); ++i) samples[i] = static_cast<float>(i);
  return samples;
}

TEST(DisplayWindow, IsBetweenPercentilesWithinTheRange) {
  EXPECT_EQ(window_of<float>({10, 10, 10}, ramp(1000)), (DisplayWindow{0, 999, 5, 994}));
  // Padding is none of the samples, and neither is what is no number.
  auto odd = ramp(1000);
  odd[500] = std::numeric_limits<float>::quiet_NaN();
  odd[501] = std::numeric_limits<float>::infinity();
  const auto window = window_of<float>({10, 10, 10}, odd, {.brick = 16, .levels = 1});
  EXPECT_EQ(window->start, 5);
  EXPECT_EQ(window->end, 994);
  EXPECT_EQ(window->max, 999);
}

TEST(DisplayWindow, ShowsWhatIsRareAndNeverIsEmpty) {
  std::vector<std::uint8_t> samples(1000);
  EXPECT_EQ(window_of<std::uint8_t>({10, 10, 10}, samples), (DisplayWindow{0, 0, 0, 1}));
  samples[123] = 200;
  EXPECT_EQ(window_of<std::uint8_t>({10, 10, 10}, samples), (DisplayWindow{0, 200, 0, 200}));
  const std::vector<float> none(1000, std::numeric_limits<float>::quiet_NaN());
  EXPECT_EQ(window_of<float>({10, 10, 10}, none), std::nullopt);
}

TEST(DisplayWindow, OfALargeVolumeWithoutAPyramidReadsSomeBricks) {
  const Int3 extent{512, 128, 160};
  TemporaryFolder folder;
  std::vector<std::uint8_t> samples(static_cast<std::size_t>(volume(extent)));
  for (std::size_t i = 0; i < samples.size(); ++i)
    samples[i] = static_cast<std::uint8_t>(i % 512 / 2);
  MemorySource source(extent, ScalarType::u8, as_bytes(samples));
  convert_quietly(source, folder / "a", {.brick = 32, .levels = 1});
  const StoreReader store(folder / "a");
  const DisplayWindow window = *display_window(store);
  EXPECT_EQ(window.min, 0);
  EXPECT_EQ(window.max, 255);
  EXPECT_LT(window.start, 20);
  EXPECT_GT(window.end, 235);
  EXPECT_LT(store.brick_times().bytes_decoded, samples.size() / 4);
  // Of few bricks that are large, one.
  convert_quietly(source, folder / "b", {.brick = 256, .levels = 1});
  EXPECT_LT(display_window(StoreReader(folder / "b"))->start, 20);
}

}  // namespace
}  // namespace isobrick::test
