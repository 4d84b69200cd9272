#pragma once

#include <cmath>
#include <vector>

#include <isobrick/mesh.h>

namespace isobrick::inline v0 {

struct TestMesh {
  std::vector<Vec3f> positions, normals;
  std::vector<Triangle> triangles;

  MeshChunk chunk(std::uint64_t first_vertex = 0, bool with_normals = true) const {
    return {first_vertex, positions,
            with_normals ? std::span<const Vec3f>(normals) : std::span<const Vec3f>(), triangles};
  }
};

/// A ball of `rings` × 2·`rings` quads, halved.
inline TestMesh make_ball(Vec3f centre, float radius, std::uint32_t rings) {
  TestMesh mesh;
  const std::uint32_t around = 2 * rings;
  for (std::uint32_t i = 0; i <= rings; ++i)
    for (std::uint32_t k = 0; k < around; ++k) {
      const double v = 3.14159265358979 * i / rings, u = 2 * 3.14159265358979 * k / around;
      const Vec3f n{static_cast<float>(std::sin(v) * std::cos(u)),
                    static_cast<float>(std::sin(v) * std::sin(u)), static_cast<float>(std::cos(v))};
      mesh.normals.push_back(n);
      mesh.positions.push_back(centre + n * radius);
    }
  for (std::uint32_t i = 0; i < rings; ++i)
    for (std::uint32_t k = 0; k < around; ++k) {
      const std::uint32_t a = i * around + k, b = i * around + (k + 1) % around;
      mesh.triangles.push_back({a, a + around, b});
      mesh.triangles.push_back({b, a + around, b + around});
    }
  return mesh;
}

}  // namespace isobrick
