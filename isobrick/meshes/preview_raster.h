#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <span>
#include <vector>

#include "isobrick/meshes/preview_camera.h"
#include "isobrick/surface/mesh.h"

namespace isobrick {

/// What is seen at each point of a picture: depth and normal, shaded later.
class PreviewRaster {
 public:
  PreviewRaster(int width, int height);

  int width() const { return width_; }
  int height() const { return height_; }

  /// Draws the triangles of a chunk (numbered from its first vertex) both
  /// sides; facet normals are taken where it brings none.
  void draw(const PreviewCamera& camera, const MeshChunk& chunk);

  /// Reciprocal depth at a point, 0 where nothing was drawn.
  float inverse_depth(int x, int y) const {
    return std::bit_cast<float>(static_cast<std::uint32_t>(at(x, y) >> 32));
  }
  /// In camera space, turned towards the eye; unit length up to rounding.
  Vec3f normal(int x, int y) const;

 private:
  /// Half-open.
  struct PixelBox {
    int x0 = 0, y0 = 0, x1 = 0, y1 = 0;
  };

  std::uint64_t at(int x, int y) const {
    return points_[static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) +
                   static_cast<std::size_t>(x)];
  }
  void project(const PreviewCamera& camera, const MeshChunk& chunk);
  PixelBox covered(Vec3f a, Vec3f b, Vec3f c) const;
  void draw_triangle(const PixelBox& box, const PreviewCamera& camera,
                     const std::array<Vec3f, 3>& at, const std::array<Vec3f, 3>& normal);

  int width_, height_;
  /// Reciprocal depth (its bits grow with it) above a packed normal: the
  /// nearest is the largest, so one comparison and one store do.
  std::vector<std::uint64_t> points_;
  std::vector<Vec3f> projected_;  ///< of the chunk at hand
};

}  // namespace isobrick
