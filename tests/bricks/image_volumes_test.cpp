#include "bricks/image_volumes.h"

#include <gtest/gtest.h>

#include <filesystem>

#include <isobrick/store_reader.h>
#include "tests/io/bytes/temp_dir.h"

namespace isobrick::inline v0 {
namespace {

class ImageVolumesTest : public testing::Test {
 protected:
  /// An image of 4³ samples with these axes before z, y and x, and so many places on each.
  std::filesystem::path write(const std::string& axes, const std::string& counts) {
    const std::filesystem::path image = dir_ / "image.zarr";
    std::filesystem::create_directories(image / "0");
    std::string ones;
    for (const char c : counts) ones += c == ',' ? "1," : "";
    dir_.write("image.zarr/.zgroup", R"({"zarr_format": 2})");
    dir_.write("image.zarr/.zattrs",
               R"({"multiscales": [{"version": "0.4", "axes": [)" + axes +
                   R"({"name": "z", "type": "space"}, {"name": "y", "type": "space"},
                   {"name": "x", "type": "space"}], "datasets": [{"path": "0",
                   "coordinateTransformations": [{"type": "scale", "scale": [)" +
                   ones + R"(1, 1, 1]}]}]}], "omero": {"channels": [{"label": "walls"}]}})");
    dir_.write("image.zarr/0/.zarray",
               R"({"zarr_format": 2, "shape": [)" + counts + R"(4, 4, 4], "chunks": [)" + ones +
                   R"(4, 4, 4], "dtype": "|u1", "compressor": null, "filters": null,
                   "fill_value": 0, "order": "C"})");
    return image;
  }

  TempDir dir_;
};

TEST_F(ImageVolumesTest, OfOneVolumeThereIsNothingToChoose) {
  const ImageVolumes volumes = image_volumes(write("", ""));
  EXPECT_TRUE(volumes.axes.empty());
  EXPECT_FALSE(volumes.selection.channel || volumes.selection.time);
  EXPECT_EQ(text_of(volumes), "");
  EXPECT_TRUE(image_volumes(write(R"({"name": "c", "type": "channel"},)", "1,")).axes.empty());
}

TEST_F(ImageVolumesTest, WhatIsLeftOpenIsTheFirst) {
  const std::filesystem::path image =
      write(R"({"name": "t", "type": "time"}, {"name": "c", "type": "channel"},)", "3,2,");
  const ImageVolumes first = image_volumes(image);
  ASSERT_EQ(first.axes.size(), 2u);
  EXPECT_EQ(first.axes[0].count, 3);
  EXPECT_EQ(first.channel_names, std::vector<std::string>{"walls"});
  EXPECT_EQ(text_of(first), "time 0, channel 0");
  const ImageVolumes chosen = image_volumes(image, {.channel = {}, .time = 2});
  EXPECT_EQ(text_of(chosen), "time 2, channel 0");
  EXPECT_EQ(StoreReader(image, chosen.selection).info().additions, "isobrick/time_2_channel_0");
  EXPECT_EQ(place_on(chosen.axes[0], chosen.selection), 2);
}

/// An axis without a role takes either number.
TEST_F(ImageVolumesTest, AnAxisOfNoKindIsChosenByEither) {
  const std::filesystem::path image = write(R"({"name": "q"},)", "5,");
  const ImageVolumes first = image_volumes(image);
  ASSERT_EQ(first.axes.size(), 1u);
  EXPECT_EQ(first.selection.channel, 0);
  EXPECT_FALSE(first.selection.time);
  const ImageVolumes third = image_volumes(image, {.channel = {}, .time = 3});
  EXPECT_FALSE(third.selection.channel);
  EXPECT_EQ(text_of(third), "time 3");
  for (const ImageVolumes& volumes : {first, third})
    EXPECT_NO_THROW(StoreReader(image, volumes.selection));
}

}  // namespace
}  // namespace isobrick
