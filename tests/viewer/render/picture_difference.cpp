#include "tests/viewer/render/picture_difference.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

namespace isobrick::test {
namespace {

using Pixel = std::array<double, 3>;

double to_linear(std::uint8_t v) {
  const double s = v / 255.0;
  return s <= 0.04045 ? s / 12.92 : std::pow((s + 0.055) / 1.055, 2.4);
}

std::vector<Pixel> linear(const PngPicture& picture) {
  std::vector<Pixel> pixels(picture.rgb.size() / 3);
  for (std::size_t i = 0; i < pixels.size(); ++i)
    for (std::size_t c = 0; c < 3; ++c) pixels[i][c] = to_linear(picture.rgb[3 * i + c]);
  return pixels;
}

/// Filters along one direction; the border pixel is repeated.
std::vector<Pixel> blurred(const std::vector<Pixel>& from, int width, int height, int dx, int dy) {
  constexpr std::array<double, 5> weights{1 / 16.0, 4 / 16.0, 6 / 16.0, 4 / 16.0, 1 / 16.0};
  std::vector<Pixel> to(from.size());
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      for (int i = 0; i < 5; ++i) {
        const int at_x = std::clamp(x + (i - 2) * dx, 0, width - 1);
        const int at_y = std::clamp(y + (i - 2) * dy, 0, height - 1);
        for (std::size_t c = 0; c < 3; ++c)
          to[static_cast<std::size_t>(y * width + x)][c] +=
              weights[static_cast<std::size_t>(i)] *
              from[static_cast<std::size_t>(at_y * width + at_x)][c];
      }
  return to;
}

/// Linear sRGB to CIELAB, white D65.
Pixel lab(const Pixel& p) {
  const auto f = [](double t) {
    return t > 216.0 / 24389 ? std::cbrt(t) : (24389.0 / 27 * t + 16) / 116;
  };
  const double x = f((0.4124 * p[0] + 0.3576 * p[1] + 0.1805 * p[2]) / 0.9505);
  const double y = f(0.2126 * p[0] + 0.7152 * p[1] + 0.0722 * p[2]);
  const double z = f((0.0193 * p[0] + 0.1192 * p[1] + 0.9505 * p[2]) / 1.089);
  return {116 * y - 16, 500 * (x - y), 200 * (y - z)};
}

std::vector<Pixel> seen(const PngPicture& picture) {
  const int w = picture.width, h = picture.height;
  std::vector<Pixel> pixels = blurred(blurred(linear(picture), w, h, 1, 0), w, h, 0, 1);
  for (Pixel& p : pixels) p = lab(p);
  return pixels;
}

}  // namespace

PictureDifference difference(const PngPicture& a, const PngPicture& b) {
  const std::vector<Pixel> p = seen(a), q = seen(b);
  PictureDifference d;
  for (std::size_t i = 0; i < p.size(); ++i) {
    const double apart = std::hypot(p[i][0] - q[i][0], p[i][1] - q[i][1], p[i][2] - q[i][2]);
    d.mean += apart;
    d.share += apart > PictureDifference::kNoticed;
  }
  d.mean /= static_cast<double>(p.size());
  d.share /= static_cast<double>(p.size());
  return d;
}

}  // namespace isobrick::test
