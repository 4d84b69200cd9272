#pragma once

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <random>
#include <utility>
#include <vector>

#include <isobrick/mesh.h>
#include "io/meshes/levels/chunk_lattice.h"

namespace isobrick::test {

/// Sides of triangles less their reverses, of those that have more of one: 0 for closed surfaces.
inline std::size_t open_sides(const std::vector<LatticeTriangle>& triangles) {
  std::map<std::pair<LatticePoint, LatticePoint>, int> sides;
  for (const LatticeTriangle& t : triangles)
    for (std::size_t i = 0; i < 3; ++i) {
      const LatticePoint &a = t[i], &b = t[(i + 1) % 3];
      if (a < b)
        ++sides[{a, b}];
      else
        --sides[{b, a}];
    }
  std::size_t open = 0;
  for (const auto& [side, count] : sides) open += count != 0;
  return open;
}

/// Six times the volume that triangles enclose, in steps.
inline double volume_of(const std::vector<LatticeTriangle>& triangles) {
  double sum = 0;
  for (const LatticeTriangle& t : triangles) {
    double c[3][3];
    for (std::size_t i = 0; i < 3; ++i)
      for (std::size_t axis = 0; axis < 3; ++axis) c[i][axis] = static_cast<double>(t[i][axis]);
    sum += c[0][0] * (c[1][1] * c[2][2] - c[1][2] * c[2][1]) +
           c[0][1] * (c[1][2] * c[2][0] - c[1][0] * c[2][2]) +
           c[0][2] * (c[1][0] * c[2][1] - c[1][1] * c[2][0]);
  }
  return sum;
}

inline Mesh mesh_of(const std::vector<Vec3f>& positions, const std::vector<Triangle>& triangles) {
  Mesh mesh;
  mesh.positions.resize(positions.size());
  mesh.triangles.resize(triangles.size());
  std::ranges::copy(positions, mesh.positions.begin());
  std::ranges::copy(triangles, mesh.triangles.begin());
  return mesh;
}

/// A torus of `around` × `around` / 2 quads, halved: closed, without poles.
inline Mesh make_torus(std::uint32_t around, Vec3f centre = {}, float radius = 4) {
  std::vector<Vec3f> positions;
  std::vector<Triangle> triangles;
  const std::uint32_t across = around / 2;
  for (std::uint32_t i = 0; i < around; ++i)
    for (std::uint32_t k = 0; k < across; ++k) {
      const double u = 2 * std::numbers::pi * i / around, v = 2 * std::numbers::pi * k / across;
      const double r = 1 + 0.4 * std::cos(v);
      positions.push_back(centre + Vec3f{static_cast<float>(r * std::cos(u)),
                                         static_cast<float>(r * std::sin(u)),
                                         static_cast<float>(0.4 * std::sin(v))} *
                                       radius);
    }
  for (std::uint32_t i = 0; i < around; ++i)
    for (std::uint32_t k = 0; k < across; ++k) {
      const std::uint32_t next = (i + 1) % around, beside = (k + 1) % across;
      const std::uint32_t a = i * across + k, b = next * across + k, c = next * across + beside,
                          d = i * across + beside;
      triangles.push_back({a, b, c});
      triangles.push_back({a, c, d});
    }
  return mesh_of(positions, triangles);
}

/// A rough sheet just below the plane z = 0.5, which a few vertices cross, and a tetrahedron at z =
/// 0.
inline Mesh sheet_below_a_plane() {
  constexpr std::uint32_t n = 512;
  std::mt19937 random(3);
  std::uniform_real_distribution<float> height(0.4985F, 0.49999F);
  std::vector<Vec3f> positions{{0, 0, 0}, {0.01F, 0, 0}, {0, 0.01F, 0}, {0, 0, 0.01F}};
  std::vector<Triangle> triangles{{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}};
  for (std::uint32_t i = 0; i <= n; ++i)
    for (std::uint32_t k = 0; k <= n; ++k)
      positions.push_back({static_cast<float>(i) / n, static_cast<float>(k) / n,
                           i % 64 == 32 && k % 64 == 32 ? 0.50001F : height(random)});
  for (std::uint32_t i = 0; i < n; ++i)
    for (std::uint32_t k = 0; k < n; ++k) {
      const std::uint32_t a = 4 + i * (n + 1) + k, b = a + n + 1;
      triangles.push_back({a, b, b + 1});
      triangles.push_back({a, b + 1, a + 1});
    }
  return mesh_of(positions, triangles);
}

}  // namespace isobrick::test
