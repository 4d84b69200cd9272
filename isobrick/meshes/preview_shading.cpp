#include "isobrick/meshes/preview_shading.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace isobrick {
namespace {

float to_linear(float v) {
  return v <= 0.04045f ? v / 12.92f : std::pow((v + 0.055f) / 1.055f, 2.4f);
}
float to_srgb(float v) {
  return v <= 0.0031308f ? 12.92f * v : 1.055f * std::pow(v, 1 / 2.4f) - 0.055f;
}
Vec3f to_linear(Vec3f c) { return {to_linear(c.x), to_linear(c.y), to_linear(c.z)}; }

std::uint8_t to_byte(float linear) {
  return static_cast<std::uint8_t>(to_srgb(std::clamp(linear, 0.0f, 1.0f)) * 255.0f + 0.5f);
}

/// Linear light that a surface sends to the eye. Camera space: y is down and
/// the normal's z is negative.
Vec3f lit(Vec3f normal, Vec3f colour) {
  constexpr Vec3f key{-0.48f, -0.62f, -0.62f};  // from above, left and in front
  constexpr Vec3f sky{0.98f, 0.99f, 1.03f}, ground{0.62f, 0.58f, 0.55f};
  const float facing = std::clamp(-normal.z, 0.0f, 1.0f);
  const float diffuse = std::max(dot(normal, key), 0.0f);
  const float up = 0.5f - 0.5f * normal.y;
  const Vec3f around = sky * up + ground * (1 - up);
  Vec3f light = around * 0.24f + Vec3f{1, 1, 1} * (0.16f * facing + 0.76f * diffuse);
  // Halfway between the key light and the eye.
  constexpr Vec3f halfway{-0.267f, -0.345f, -0.900f};
  const float gloss = std::pow(std::max(dot(normal, halfway), 0.0f), 40.0f);
  const float rim = (1 - facing) * (1 - facing) * (1 - facing) * std::max(-normal.y, 0.0f);
  return colour * light + Vec3f{1, 1, 1} * (0.10f * gloss + 0.18f * rim);
}

/// How much light reaches each pixel through the depth around it.
class Ambient {
 public:
  Ambient(const PreviewRaster& raster, float pixel)
      : width_(raster.width() / 2),
        height_(raster.height() / 2),
        pixel_(2 * pixel),
        depths_(static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_)) {
    make_rings();
    for (int y = 0; y < height_; ++y)
      for (int x = 0; x < width_; ++x) {
        // Of the four points the nearest.
        float w = 0;
        for (int i = 0; i < 4; ++i)
          w = std::max(w, raster.inverse_depth(2 * x + (i & 1), 2 * y + (i >> 1)));
        depths_[index(x, y)] = w;
      }
  }

  /// Factor in (0, 1].
  float at(int x, int y) const {
    const float w = depths_[index(x, y)];
    if (w <= 0) return 1;
    float closed = 0;
    for (const Ring& ring : rings_) closed += ring_closure(x, y, w, ring);
    return 1 / (1 + kStrength * closed / kRings);
  }

 private:
  static constexpr int kRings = 5;
  static constexpr float kStrength = 2.4f;

  /// Neighbours at one distance; each stands for itself and its opposite.
  struct Ring {
    float radius = 0;  ///< pixels
    std::array<std::array<int, 2>, 4> offsets{};
  };

  void make_rings() {
    static constexpr float directions[4][2] = {
        {0.97f, 0.24f}, {0.52f, 0.86f}, {-0.24f, 0.97f}, {-0.86f, 0.52f}};
    // The same look at every size of the picture.
    float radius = 1.6f * static_cast<float>(std::min(width_, height_)) / 768.0f;
    for (int i = 0; i < kRings; ++i, radius *= 1.9f) {
      Ring& ring = rings_[static_cast<std::size_t>(i)];
      ring.radius = std::max(radius, 1.0f + static_cast<float>(i));
      for (std::size_t k = 0; k < ring.offsets.size(); ++k)
        for (std::size_t axis = 0; axis < 2; ++axis)
          ring.offsets[k][axis] = static_cast<int>(std::lround(directions[k][axis] * ring.radius));
    }
  }

  std::size_t index(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) +
           static_cast<std::size_t>(x);
  }

  /// Mean over pairs of opposite neighbours of how far they stand out above
  /// the pixel. Reciprocal depth is linear on a plane, so a slope alone is not dark.
  float ring_closure(int x, int y, float w, const Ring& ring) const {
    // A ball of this radius at the pixel's depth reaches so far in depth.
    const float reach = ring.radius * pixel_ * w;
    float sum = 0;
    for (const auto& [dx, dy] : ring.offsets) {
      const float rise = rise_of(x + dx, y + dy, w) + rise_of(x - dx, y - dy, w);
      sum += std::clamp(rise / reach, 0.0f, 1.0f);
    }
    return sum / static_cast<float>(ring.offsets.size());
  }

  /// How much nearer than w, both ways limited: what is far in front is no
  /// wall of the same hole, and the background counts as far behind.
  float rise_of(int x, int y, float w) const {
    if (x < 0 || y < 0 || x >= width_ || y >= height_) return 0;
    const float limit = 0.06f * w;
    return std::clamp(depths_[index(x, y)] - w, -limit, limit);
  }

  int width_, height_;
  float pixel_;
  std::vector<float> depths_;
  std::array<Ring, kRings> rings_;
};

}  // namespace

std::vector<std::uint8_t> shade_preview(const PreviewRaster& raster, float pixel, Vec3f colour) {
  const int width = raster.width() / 2, height = raster.height() / 2;
  const Vec3f top = to_linear(Vec3f{0.95f, 0.96f, 0.97f});
  const Vec3f bottom = to_linear(Vec3f{0.74f, 0.77f, 0.80f});
  const Vec3f surface = to_linear(colour);
  const Ambient ambient(raster, pixel);
  std::vector<std::uint8_t> rgb;
  rgb.reserve(3 * static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  for (int y = 0; y < height; ++y) {
    const float down = (static_cast<float>(y) + 0.5f) / static_cast<float>(height);
    const Vec3f background = top * (1 - down) + bottom * down;
    for (int x = 0; x < width; ++x) {
      const float open = ambient.at(x, y);
      Vec3f sum;
      for (int i = 0; i < 4; ++i) {
        const int px = 2 * x + (i & 1), py = 2 * y + (i >> 1);
        sum = sum + (raster.inverse_depth(px, py) > 0 ? lit(raster.normal(px, py), surface) * open
                                                      : background);
      }
      for (int i = 0; i < 3; ++i) rgb.push_back(to_byte(0.25f * sum[i]));
    }
  }
  return rgb;
}

}  // namespace isobrick
