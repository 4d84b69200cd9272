#include "isobrick/meshes/preview_raster.h"

#include <algorithm>
#include <cmath>

namespace isobrick {
namespace {

std::uint32_t pack_component(float v) {
  return static_cast<std::uint32_t>(std::clamp(v, -1.0f, 1.0f) * 511.0f + 511.5f);
}

/// 10 bits a component.
std::uint32_t pack_normal(Vec3f n) {
  const float length2 = n.x * n.x + n.y * n.y + n.z * n.z;
  // Towards the eye: both sides are lit alike.
  if (length2 > 0 && std::isfinite(length2))
    n = n * ((n.z > 0 ? -1.0f : 1.0f) / std::sqrt(length2));
  else
    n = {0, 0, -1};
  return pack_component(n.x) | pack_component(n.y) << 10 | pack_component(n.z) << 20;
}

float unpack_component(std::uint64_t bits) {
  return (static_cast<float>(bits & 1023) - 511.0f) * (1.0f / 511.0f);
}

}  // namespace

PreviewRaster::PreviewRaster(int width, int height)
    : width_(width),
      height_(height),
      points_(static_cast<std::size_t>(width) * static_cast<std::size_t>(height)) {}

Vec3f PreviewRaster::normal(int x, int y) const {
  const std::uint64_t bits = at(x, y);
  return {unpack_component(bits), unpack_component(bits >> 10), unpack_component(bits >> 20)};
}

void PreviewRaster::project(const PreviewCamera& camera, const MeshChunk& chunk) {
  projected_.resize(chunk.positions.size());
  for (std::size_t i = 0; i < projected_.size(); ++i)
    projected_[i] = camera.project(chunk.positions[i]);
}

PreviewRaster::PixelBox PreviewRaster::covered(Vec3f a, Vec3f b, Vec3f c) const {
  const float left = std::min({a.x, b.x, c.x}), right = std::max({a.x, b.x, c.x});
  const float top = std::min({a.y, b.y, c.y}), bottom = std::max({a.y, b.y, c.y});
  const auto width = static_cast<float>(width_), height = static_cast<float>(height_);
  if (!(right > 0 && bottom > 0 && left < width && top < height)) return {};  // NaN too
  // Rounding half up counts the points (at .5) before a place.
  const auto round = [](float v) { return static_cast<int>(v + 0.5f); };
  return {round(std::max(left, 0.0f)), round(std::max(top, 0.0f)), round(std::min(right, width)),
          round(std::min(bottom, height))};
}

void PreviewRaster::draw(const PreviewCamera& camera, const MeshChunk& chunk) {
  project(camera, chunk);
  for (const Triangle& t : chunk.triangles) {
    const Vec3f a = projected_[t[0]], b = projected_[t[1]], c = projected_[t[2]];
    // Most triangles are small and lie between the points: those end here.
    const PixelBox box = covered(a, b, c);
    if (box.x0 >= box.x1 || box.y0 >= box.y1) continue;
    if (a.z <= 0 || b.z <= 0 || c.z <= 0) continue;  // behind the eye

    if (chunk.normals.empty()) {
      const Vec3f p = chunk.positions[t[0]];
      const Vec3f facet = cross(chunk.positions[t[1]] - p, chunk.positions[t[2]] - p);
      draw_triangle(box, camera, {a, b, c}, {facet, facet, facet});
    } else {
      draw_triangle(box, camera, {a, b, c},
                    {chunk.normals[t[0]], chunk.normals[t[1]], chunk.normals[t[2]]});
    }
  }
}

void PreviewRaster::draw_triangle(const PixelBox& box, const PreviewCamera& camera,
                                  const std::array<Vec3f, 3>& at,
                                  const std::array<Vec3f, 3>& normal) {
  const Vec3f ab = at[1] - at[0], ac = at[2] - at[0];
  const float area = ab.x * ac.y - ab.y * ac.x;
  if (area == 0 || !std::isfinite(area)) return;
  const float scale = 1 / area;
  // A hair beyond the edges, so that rounding leaves no gap between neighbours.
  constexpr float slack = -1e-5f;
  for (int y = box.y0; y < box.y1; ++y) {
    std::uint64_t* line =
        points_.data() + static_cast<std::size_t>(y) * static_cast<std::size_t>(width_);
    for (int x = box.x0; x < box.x1; ++x) {
      const float px = static_cast<float>(x) + 0.5f - at[0].x;
      const float py = static_cast<float>(y) + 0.5f - at[0].y;
      const float s = (px * ac.y - py * ac.x) * scale, t = (ab.x * py - ab.y * px) * scale;
      const float r = 1 - s - t;
      if (s < slack || t < slack || r < slack) continue;
      const float depth = at[0].z * r + at[1].z * s + at[2].z * t;
      const std::uint64_t key = std::uint64_t{std::bit_cast<std::uint32_t>(depth)} << 32;
      if (depth <= 0 || (key | 0xffffffff) <= line[x]) continue;
      const Vec3f towards = camera.rotate(normal[0] * r + normal[1] * s + normal[2] * t);
      line[x] = std::max(line[x], key | pack_normal(towards));
    }
  }
}

}  // namespace isobrick
