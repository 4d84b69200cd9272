#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "tests/surface/field.h"

// What meshes measure: areas, volumes and normals of known shapes, and their places in the world.

namespace isobrick::testing {
namespace {

struct Measures {
  double area = 0, volume = 0;
  std::ptrdiff_t euler = 0;
  double worst_radius = 0, worst_normal = 0;
};

Measures measure(const Mesh& mesh, Vec3d centre, double radius) {
  Measures m;
  const auto at = [&](std::uint32_t i) -> Vec3d {
    const Vec3f p = mesh.positions[i];
    return Vec3d{p.x, p.y, p.z} - centre;
  };
  for (const Triangle& t : mesh.triangles) {
    const Vec3d a = at(t[0]), u = at(t[1]) - a, v = at(t[2]) - a;
    const Vec3d c{u.y * v.z - u.z * v.y, u.z * v.x - u.x * v.z, u.x * v.y - u.y * v.x};
    m.area += std::sqrt(c.x * c.x + c.y * c.y + c.z * c.z) / 2;
    m.volume += (a.x * c.x + a.y * c.y + a.z * c.z) / 6;
  }
  for (std::uint32_t i = 0; i < mesh.positions.size(); ++i) {
    const Vec3d p = at(i);
    const double r = std::sqrt(p.x * p.x + p.y * p.y + p.z * p.z);
    m.worst_radius = std::max(m.worst_radius, std::abs(r - radius));
    if (!mesh.normals.empty()) {
      const Vec3f n = mesh.normals[i];
      m.worst_normal = std::max(m.worst_normal, 1 - (n.x * p.x + n.y * p.y + n.z * p.z) / r);
    }
  }
  m.euler = static_cast<std::ptrdiff_t>(mesh.positions.size()) - closed_sides(mesh) +
            static_cast<std::ptrdiff_t>(mesh.triangles.size());
  return m;
}

// The distance field is not linear along edges, so positions, area and volume
// converge with the square of the sample distance.
TEST(Extractor, SphereConvergesAtSecondOrder) {
  Measures coarse;
  for (const Index n : {17, 33, 65, 129}) {
    const double h = 2.0 / static_cast<double>(n - 1), radius = 0.7;
    const Field<float> field({n, n, n}, [&](Int3 p) {
      const Vec3d q{static_cast<double>(p.x) * h - 1, static_cast<double>(p.y) * h - 1,
                    static_cast<double>(p.z) * h - 1};
      return radius - std::sqrt(q.x * q.x + q.y * q.y + q.z * q.z);
    });
    Transform world;
    world.spacing = {h, h, h};
    world.origin = {-1, -1, -1};
    const Mesh mesh = extract(field, {.isovalue = 0, .normals = true, .transform = world});
    const Measures m = measure(mesh, {0, 0, 0}, radius);
    EXPECT_EQ(m.euler, 2);
    const double area = 4 * std::numbers::pi * radius * radius, volume = area * radius / 3;
    const Measures error{std::abs(m.area - area), std::abs(m.volume - volume), 0, m.worst_radius,
                         m.worst_normal};
    EXPECT_GT(m.volume, 0) << "normals must point to the outside";
    if (n > 17) {
      EXPECT_LT(error.area, coarse.area / 3.2);
      EXPECT_LT(error.volume, coarse.volume / 3.2);
      EXPECT_LT(error.worst_radius, coarse.worst_radius / 2.5);
      // Below this it is the rounding of float.
      EXPECT_LT(error.worst_normal, std::max(coarse.worst_normal / 2.5, 1e-6));
    }
    coarse = error;
  }
  EXPECT_LT(coarse.worst_normal, 1e-4);
}

TEST(Extractor, TorusHasEulerNumberZeroAndItsVolume) {
  const double big = 20, small = 8;
  const Field<float> field({63, 63, 30}, [&](Int3 p) {
    const double x = static_cast<double>(p.x) - 31.2, y = static_cast<double>(p.y) - 30.9,
                 z = static_cast<double>(p.z) - 14.6;
    const double ring = std::sqrt(x * x + y * y) - big;
    return small - std::sqrt(ring * ring + z * z);
  });
  const Measures m = measure(extract(field, {.isovalue = 0}), {31.2, 30.9, 14.6}, 0);
  EXPECT_EQ(m.euler, 0);
  const double volume = 2 * std::numbers::pi * std::numbers::pi * big * small * small;
  EXPECT_NEAR(m.volume / volume, 1, 0.01);
}

// A plane is exact in every cell, whatever the spacing and the direction.
TEST(Extractor, AnisotropicAndTurnedVolumesEndInWorldCoordinates) {
  Transform world;
  world.spacing = {0.5, 2, 3};
  world.origin = {10, -20, 30};
  const double c = 0.6, s = 0.8;
  world.direction = {c, -s, 0, s, c, 0, 0, 0, 1};
  // f falls along the world direction (1, 2, 3)/√14; the surface is where f = 0.
  const Vec3d n{1 / std::sqrt(14.0), 2 / std::sqrt(14.0), 3 / std::sqrt(14.0)};
  const Vec3d centre = world.apply({20, 15, 12});
  const Field<float> field({41, 33, 29}, [&](Int3 p) {
    const Vec3d q = world.apply({static_cast<double>(p.x), static_cast<double>(p.y),
                                 static_cast<double>(p.z)}) -
                    centre;
    return -(q.x * n.x + q.y * n.y + q.z * n.z);
  });
  const Mesh mesh = extract(field, {.isovalue = 0, .normals = true, .transform = world});
  ASSERT_GT(mesh.positions.size(), 500u);
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    const Vec3f p = mesh.positions[i], m = mesh.normals[i];
    EXPECT_NEAR((p.x - centre.x) * n.x + (p.y - centre.y) * n.y + (p.z - centre.z) * n.z, 0, 2e-5);
    EXPECT_NEAR(m.x * n.x + m.y * n.y + m.z * n.z, 1, 1e-5);
  }
}

TEST(Extractor, MirroredAxesKeepTheOutsideOutside) {
  const Field<float> field({40, 40, 40}, [](Int3 p) {
    const double x = static_cast<double>(p.x) - 19.3, y = static_cast<double>(p.y) - 20.1,
                 z = static_cast<double>(p.z) - 19.8;
    return 12 - std::sqrt(x * x + y * y + z * z);
  });
  for (const double sign : {1.0, -1.0}) {
    Transform world;
    world.direction = {sign, 0, 0, 0, 1, 0, 0, 0, 1};
    const Mesh mesh = extract(field, {.isovalue = 0, .normals = true, .transform = world});
    const Measures m = measure(mesh, {sign * 19.3, 20.1, 19.8}, 12);
    EXPECT_NEAR(m.volume / (4.0 / 3 * std::numbers::pi * 12 * 12 * 12), 1, 0.02);
    EXPECT_LT(m.worst_normal, 0.01);
    EXPECT_EQ(m.euler, 2);
  }
}

TEST(Extractor, ALevelSetsInsideIsBelow) {
  const Field<float> field({40, 40, 40}, [](Int3 p) {
    return std::hypot(static_cast<double>(p.x) - 19.3, static_cast<double>(p.y) - 20.1,
                      static_cast<double>(p.z) - 19.8) -
           12;
  });
  Request request{.isovalue = 0, .inside = Inside::below, .normals = true};
  const Mesh mesh = extract(field, request);
  const Measures m = measure(mesh, {19.3, 20.1, 19.8}, 12);
  EXPECT_NEAR(m.volume / (4.0 / 3 * std::numbers::pi * 12 * 12 * 12), 1, 0.02);
  EXPECT_LT(m.worst_normal, 0.01);
  EXPECT_EQ(m.euler, 2);
  // The same vertices, and normals exactly the other way.
  request.inside = Inside::above;
  const Mesh other = extract(field, request);
  EXPECT_EQ(other.positions, mesh.positions);
  ASSERT_EQ(other.normals.size(), mesh.normals.size());
  for (std::size_t i = 0; i < mesh.normals.size(); ++i)
    for (int axis = 0; axis < 3; ++axis)
      ASSERT_EQ(other.normals[i][axis], -mesh.normals[i][axis]) << i;
}

TEST(Extractor, NormalsByDefinitionEverywhere) {
  const auto field = padded_noise<float>({66, 35, 34}, -1, 1, -1.0f, 8);
  const Mesh mesh = extract(field, {.isovalue = 0.1, .brick = {32, 32, 32}, .normals = true});
  const auto gradient = [&](Int3 p) {
    Vec3f g;
    for (int axis = 0; axis < 3; ++axis) {
      Int3 lo = p, hi = p;
      if (p[axis] > 0) --lo[axis];
      if (p[axis] < field.extent[axis] - 1) ++hi[axis];
      const float d = field.at(hi) - field.at(lo);
      g[axis] = hi[axis] - lo[axis] == 2 ? d * 0.5f : d;
    }
    return g;
  };
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    const EdgeKey e = edge_of(mesh.positions[i]);
    if (e[3] < 0) continue;
    const Int3 a{e[0], e[1], e[2]};
    Int3 b = a;
    ++b[static_cast<int>(e[3])];
    const float va = field.at(a), vb = field.at(b), t = (0.1f - va) / (vb - va);
    const Vec3f ga = gradient(a), gb = gradient(b);
    const Vec3f g{ga.x + t * (gb.x - ga.x), ga.y + t * (gb.y - ga.y), ga.z + t * (gb.z - ga.z)};
    const float length = std::sqrt(g.x * g.x + g.y * g.y + g.z * g.z);
    ASSERT_NEAR(mesh.normals[i].x, -g.x / length, 1e-5);
    ASSERT_NEAR(mesh.normals[i].y, -g.y / length, 1e-5);
    ASSERT_NEAR(mesh.normals[i].z, -g.z / length, 1e-5);
  }
}

}  // namespace
}  // namespace isobrick::testing
