#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "viewer/scene/node_mesh.h"

namespace isobrick::test {

/// Rasterises meshes in a parallel projection; counts the surfaces along each ray.
class Rasteriser {
 public:
  Rasteriser(int size, Vec3d middle, double radius, unsigned seed)
      : size_(size), middle_(middle), scale_(size / (2 * radius)), pixels_(size_t(size * size)) {
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    double q[4], length = 0;
    for (double& c : q) {
      c = normal(random);
      length += c * c;
    }
    for (double& c : q) c /= std::sqrt(length);
    const double w = q[0], x = q[1], y = q[2], z = q[3];
    rows_ = {{{1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)},
              {2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)},
              {2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)}}};
  }

  /// Seam strips are counted apart: they lie across the surface.
  void draw(const NodeMesh& mesh) {
    const std::size_t seam_strips = mesh.mesh.triangles.size() - mesh.seam_triangles;
    for (std::size_t t = 0; t < mesh.mesh.triangles.size(); ++t) {
      std::array<Vec3d, 3> corners;
      for (std::size_t k = 0; k < 3; ++k) {
        const Vec3f p = mesh.mesh.positions[mesh.mesh.triangles[t][k]];
        corners[k] = project({p.x, p.y, p.z});
      }
      draw(corners, t >= seam_strips);
    }
  }

  struct Pixel {
    int front = 0, back = 0;  ///< surfaces crossed, without seam strips
    double nearest = std::numeric_limits<double>::infinity();
    bool nearest_is_back = false;
  };
  const std::vector<Pixel>& pixels() const { return pixels_; }

 private:
  using size_t = std::size_t;
  Vec3d project(Vec3d p) const {
    const Vec3d v = p - middle_;
    Vec3d out;
    for (int i = 0; i < 3; ++i) {
      const Vec3d& r = rows_[size_t(i)];
      out[i] = (r.x * v.x + r.y * v.y + r.z * v.z) * scale_;
    }
    return {out.x + size_ / 2.0, out.y + size_ / 2.0, out.z};
  }
  /// The side of the line a → b; exactly the opposite for b → a.
  static double side(const Vec3d& a, const Vec3d& b, double x, double y) {
    if (b.x < a.x || (b.x == a.x && b.y < a.y)) return -side(b, a, x, y);
    return (b.x - a.x) * (y - a.y) - (b.y - a.y) * (x - a.x);
  }
  void draw(std::array<Vec3d, 3> c, bool seam_strip) {
    const double area = side(c[0], c[1], c[2].x, c[2].y);
    if (area == 0) return;
    // Small z is towards the viewer; counter-clockwise seen from there is clockwise in (x, y).
    const bool front = area < 0;
    const auto low = [&](auto get) { return std::min({get(c[0]), get(c[1]), get(c[2])}); };
    const auto high = [&](auto get) { return std::max({get(c[0]), get(c[1]), get(c[2])}); };
    const auto x = [](const Vec3d& v) { return v.x; };
    const auto y = [](const Vec3d& v) { return v.y; };
    for (int j = std::max(0, int(std::floor(low(y)))); j <= std::min(size_ - 1, int(high(y))); ++j)
      for (int i = std::max(0, int(std::floor(low(x)))); i <= std::min(size_ - 1, int(high(x)));
           ++i) {
        const double px = i + 0.4999, py = j + 0.4997;
        const double a = side(c[1], c[2], px, py), b = side(c[2], c[0], px, py),
                     d = side(c[0], c[1], px, py);
        const bool inside = front ? a < 0 && b < 0 && d < 0 : a >= 0 && b >= 0 && d >= 0;
        if (!inside) continue;
        Pixel& pixel = pixels_[size_t(j * size_ + i)];
        const double z = (a * c[0].z + b * c[1].z + d * c[2].z) / (a + b + d);
        if (!seam_strip) ++(front ? pixel.front : pixel.back);
        if (z < pixel.nearest) {
          pixel.nearest = z;
          pixel.nearest_is_back = !front && !seam_strip;
        }
      }
  }

  int size_;
  Vec3d middle_;
  double scale_;
  std::array<Vec3d, 3> rows_;
  std::vector<Pixel> pixels_;
};

}  // namespace isobrick::test
