#pragma once

#include <gtest/gtest.h>
#include <png.h>

#include <cstdint>
#include <string>
#include <vector>

namespace isobrick::test {

/// A picture read from a PNG file.
struct PngPicture {
  int width = 0, height = 0;
  std::vector<std::uint8_t> rgb;  ///< rows from the top

  const std::uint8_t* at(int x, int y) const { return rgb.data() + 3 * (y * width + x); }
  /// The background is bluish, the surface reddish.
  bool surface(int x, int y) const { return at(x, y)[0] > at(x, y)[2] + 8; }
  int brightness(int x, int y) const { return at(x, y)[0] + at(x, y)[1] + at(x, y)[2]; }
};

inline PngPicture read_png(const std::string& path) {
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  EXPECT_NE(png_image_begin_read_from_file(&image, path.c_str()), 0) << path;
  image.format = PNG_FORMAT_RGB;
  PngPicture picture{static_cast<int>(image.width), static_cast<int>(image.height), {}};
  picture.rgb.resize(PNG_IMAGE_SIZE(image));
  EXPECT_NE(png_image_finish_read(&image, nullptr, picture.rgb.data(), 0, nullptr), 0) << path;
  return picture;
}

}  // namespace isobrick::test
