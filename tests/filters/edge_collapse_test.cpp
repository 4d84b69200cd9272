#include "filters/edge_collapse.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <random>
#include <set>

#include "filters/collapse_error.h"
#include "filters/collapse_spool.h"
#include "filters/removed_points.h"
#include "tests/filters/far_triangles.h"
#include "tests/filters/filter_fixture.h"

namespace isobrick::test {
namespace {

constexpr double kAnyDistance = std::numeric_limits<double>::infinity();

TriangleGroup group_of(std::vector<Vec3f> positions, std::vector<Triangle> triangles) {
  TriangleGroup group;
  group.vertices = positions.size();
  group.positions = std::move(positions);
  group.triangles = std::move(triangles);
  return group;
}

Mesh mesh_of(const TriangleGroup& group, const std::vector<Triangle>& triangles) {
  Mesh mesh;
  mesh.positions.resize(group.positions.size());
  mesh.triangles.resize(triangles.size());
  std::ranges::copy(group.positions, mesh.positions.begin());
  std::ranges::copy(triangles, mesh.triangles.begin());
  return mesh;
}

/// Two poles and a ring between them.
TriangleGroup bipyramid(std::uint32_t ring, float height, float radius) {
  std::vector<Vec3f> positions{{0, 0, height}, {0, 0, -height}};
  std::vector<Triangle> triangles;
  for (std::uint32_t i = 0; i < ring; ++i) {
    const double angle = 2 * std::numbers::pi * i / ring;
    positions.push_back({radius * static_cast<float>(std::cos(angle)),
                         radius * static_cast<float>(std::sin(angle)), 0});
    const std::uint32_t a = 2 + i, b = 2 + (i + 1) % ring;
    triangles.push_back({0, a, b});
    triangles.push_back({1, b, a});
  }
  return group_of(positions, triangles);
}

/// A square of n x n squares in the plane z = 0.
TriangleGroup sheet(std::uint32_t n) {
  std::vector<Vec3f> positions;
  std::vector<Triangle> triangles;
  for (std::uint32_t j = 0; j <= n; ++j)
    for (std::uint32_t i = 0; i <= n; ++i) {
      positions.push_back({static_cast<float>(i), static_cast<float>(j), 0});
      if (i == n || j == n) continue;
      const std::uint32_t a = j * (n + 1) + i, b = a + n + 1;
      triangles.push_back({a, a + 1, b + 1});
      triangles.push_back({a, b + 1, b});
    }
  return group_of(positions, triangles);
}

std::vector<Triangle> simplified(const TriangleGroup& group, std::size_t least,
                                 double max_distance = kAnyDistance) {
  return collapsed(group, final_vertices(group, EdgeCollapse(group, max_distance).run(least)));
}

TEST(EdgeCollapse, StopsAtATetrahedron) {
  const TriangleGroup group = bipyramid(9, 1, 1);
  const std::vector<Triangle> left = simplified(group, 0);
  EXPECT_EQ(left.size(), 4U);
  EXPECT_EQ(measure(mesh_of(group, left)).euler_number, 2);
}

TEST(EdgeCollapse, VerticesAtOnePlace) {
  const TriangleGroup group = bipyramid(8, 0, 0);
  EXPECT_EQ(simplified(group, 0).size(), 4U);
}

TEST(EdgeCollapse, AWaistStays) {
  // A tube whose middle ring is one place: merged, its ends would meet in a point.
  std::vector<Vec3f> positions;
  std::vector<Triangle> triangles;
  for (std::uint32_t level = 0; level < 3; ++level)
    for (std::uint32_t i = 0; i < 6; ++i) {
      const auto angle = static_cast<float>(i);
      const float radius = level == 1 ? 0.0f : 1.0f;
      positions.push_back(
          {radius * std::cos(angle), radius * std::sin(angle), static_cast<float>(level)});
      if (level == 2) continue;
      const std::uint32_t a = 6 * level + i, b = 6 * level + (i + 1) % 6;
      triangles.push_back({a, b, b + 6});
      triangles.push_back({a, b + 6, a + 6});
    }
  const TriangleGroup group = group_of(positions, triangles);
  const MeshMeasure before = measure(mesh_of(group, triangles)),
                    after = measure(mesh_of(group, simplified(group, 0)));
  EXPECT_EQ(after.euler_number, before.euler_number);
  EXPECT_EQ(after.open_sides, before.open_sides);
  EXPECT_EQ(after.components, 1U);
  EXPECT_EQ(after.vertices, before.vertices - 3);  // a ring has three at least
}

TEST(EdgeCollapse, AFlatSheetIsItsBorder) {
  const std::uint32_t n = 12;
  const TriangleGroup group = sheet(n);
  const std::vector<Triangle> left = simplified(group, 0);
  EXPECT_LE(left.size(), 4 * n + 8);
  const Mesh mesh = mesh_of(group, left);
  EXPECT_EQ(measure(mesh).open_sides, 4 * n);
  EXPECT_NEAR(measure(mesh).area, n * n, 1e-6);
  for (const Collapse& c : EdgeCollapse(group, kAnyDistance).run(0)) EXPECT_LT(c.error, 0.01);
}

TEST(EdgeCollapse, NoSideBetweenBordersIsNew) {
  const TriangleGroup group = sheet(12);
  std::set<std::pair<std::uint32_t, std::uint32_t>> before;
  for (const Triangle& t : group.triangles)
    for (std::size_t i = 0; i < 3; ++i) before.emplace(t[i], t[(i + 1) % 3]);
  const auto is_border = [&](std::uint32_t v) {
    const Vec3f p = group.positions[v];
    return p.x == 0 || p.y == 0 || p.x == 12 || p.y == 12;
  };
  for (const Triangle& t : simplified(group, 0))
    for (std::size_t i = 0; i < 3; ++i) {
      const std::uint32_t a = t[i], b = t[(i + 1) % 3];
      if (is_border(a) && is_border(b)) {
        EXPECT_TRUE(before.contains({a, b}) || before.contains({b, a})) << a << ' ' << b;
      }
    }
}

// Another group may have the other side of the triangle that would be left.
TEST(EdgeCollapse, TheLastVertexWithinATriangleStays) {
  const TriangleGroup group = group_of({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0.3f, 0.3f, 0}},
                                       {{0, 1, 3}, {1, 2, 3}, {2, 0, 3}});
  EXPECT_EQ(simplified(group, 0), group.triangles);
}

// In the plane the area grows with what is turned over.
TEST(EdgeCollapse, NoTriangleTurnsOver) {
  std::mt19937 random(3);
  for (int round = 0; round < 5; ++round) {
    TriangleGroup group = sheet(24);
    for (Vec3f& p : group.positions)
      if (p.x > 0 && p.x < 24 && p.y > 0 && p.y < 24) {
        p.x += static_cast<float>(random() % 1000) / 2500 - 0.2f;
        p.y += static_cast<float>(random() % 1000) / 2500 - 0.2f;
      }
    for (const std::size_t least : {600u, 200u, 0u})
      EXPECT_NEAR(measure(mesh_of(group, simplified(group, least))).area, 24 * 24, 1e-3) << least;
  }
}

TEST(EdgeCollapse, ErrorsAscendAndAreDistances) {
  TriangleGroup group = bipyramid(64, 1, 8);
  float last = 0;
  for (const Collapse& c : EdgeCollapse(group, kAnyDistance).run(8)) {
    EXPECT_GE(c.error, last);
    last = c.error;
  }
  EXPECT_GT(last, 0.1f);
  EXPECT_LT(last, 8.0f);
}

TEST(EdgeCollapse, KeepsTheDistance) {
  TriangleGroup group = sheet(20);
  for (Vec3f& p : group.positions) p.z = 0.5f * std::sin(p.x) * std::cos(0.7f * p.y);
  std::size_t before = group.triangles.size();
  for (const double distance : {0.05, 0.15, 0.4}) {
    const std::vector<Triangle> left = simplified(group, 0, distance);
    EXPECT_TRUE(far_triangles(group.positions, group.triangles, left, 1.0001 * distance).empty());
    EXPECT_LT(left.size(), before) << distance;
    before = left.size();
  }
}

TEST(RemovedPoints, DistancesToTriangles) {
  const Vec3d a{0, 0, 0}, b{2, 0, 0}, c{0, 2, 0};
  EXPECT_DOUBLE_EQ(squared_distance({0.5, 0.5, 1}, a, b, c), 1);
  EXPECT_DOUBLE_EQ(squared_distance({3, 0, 0}, a, b, c), 1);
  EXPECT_DOUBLE_EQ(squared_distance({-1, -1, 0}, a, b, c), 2);
  EXPECT_DOUBLE_EQ(squared_distance({2, 2, 0}, a, b, c), 2);
  EXPECT_DOUBLE_EQ(squared_distance({1, -2, 0}, a, b, c), 4);
  EXPECT_DOUBLE_EQ(squared_distance({-2, 1, 0}, a, b, c), 4);
  EXPECT_DOUBLE_EQ(squared_distance({1, 1, 1}, a, a, a), 3);
}

TEST(CollapseSpool, SelectsTheSmallestErrors) {
  CollapseSpool spool({}, 1 << 20);
  const std::vector<Collapse> first{{0, 1, 0.5f}, {1, 2, 1}, {2, 3, 4}}, second{},
      third{{5, 6, 0.25f}, {6, 7, 1}, {7, 8, 1}, {8, 9, 2}};
  for (const auto& group : {first, second, third}) spool.add(group);
  const auto counts = [&](std::uint64_t count) {
    spool.select(count);
    return std::vector{spool.load(0).size(), spool.load(1).size(), spool.load(2).size()};
  };
  using Counts = std::vector<std::size_t>;
  EXPECT_EQ(counts(0), (Counts{0, 0, 0}));
  EXPECT_EQ(counts(2), (Counts{1, 0, 1}));
  EXPECT_EQ(counts(3), (Counts{2, 0, 1}));
  EXPECT_EQ(counts(4), (Counts{2, 0, 2}));
  EXPECT_EQ(counts(6), (Counts{2, 0, 4}));
  EXPECT_EQ(counts(7), (Counts{3, 0, 4}));
  EXPECT_EQ(counts(100), (Counts{3, 0, 4}));
  EXPECT_EQ(spool.load(2), third);
  spool.clear();
  spool.add(third);
  spool.select(1);
  EXPECT_EQ(spool.load(0).front(), third.front());
}

double error_of(const TriangleGroup& group, std::size_t least) {
  const std::vector<std::uint32_t> last =
      final_vertices(group, EdgeCollapse(group, kAnyDistance).run(least));
  return collapse_error(group, last, collapsed(group, last));
}

TEST(CollapseError, IsThatOfTheVerticesThatWent) {
  EXPECT_NEAR(error_of(sheet(60), 1000), 0, 1e-9) << "all stays in the plane";
  TriangleGroup peak = sheet(4);
  peak.positions[12].z = 0.5F;
  EXPECT_EQ(error_of(peak, peak.triangles.size()), 0) << "nothing went";
  // All inside goes: the border is flat.
  EXPECT_NEAR(error_of(peak, 0), 0.5, 1e-6);
}

/// How far points are at most from triangles of a group.
double farthest(const std::vector<Vec3d>& points, const TriangleGroup& group,
                const std::vector<Triangle>& triangles) {
  const auto at = [&](std::uint32_t v) { return to_double(group.positions[v]); };
  double largest = 0;
  for (const Vec3d& p : points) {
    double least = std::numeric_limits<double>::infinity();
    for (const Triangle& t : triangles)
      least = std::min(least, squared_distance(p, at(t[0]), at(t[1]), at(t[2])));
    largest = std::max(largest, least);
  }
  return std::sqrt(largest);
}

TEST(CollapseError, TrianglesWithoutArea) {
  EXPECT_EQ(error_of(bipyramid(8, 0, 0), 0), 0);
  // Two corners of what is left are at one place.
  const TriangleGroup group =
      group_of({{0.3F, 0, 1}, {0, 0, 0}, {0, 0, 0}, {1, 0, 0}}, {{0, 2, 3}, {1, 2, 3}});
  const std::vector<std::uint32_t> last{1, 1, 2, 3};
  EXPECT_NEAR(collapse_error(group, last, collapsed(group, last)), 1, 0.1);
}

TEST(CollapseError, IsThatOfCentresToo) {
  std::mt19937 random(4);
  std::uniform_real_distribution<float> shift(-0.2F, 0.2F);
  int of_centres_alone = 0;
  for (int round = 0; round < 200; ++round) {
    TriangleGroup group = bipyramid(12, 1, 1);
    for (Vec3f& p : group.positions) p = p + Vec3f{shift(random), shift(random), shift(random)};
    const std::vector<std::uint32_t> last =
        final_vertices(group, EdgeCollapse(group, kAnyDistance).run(20));
    const std::vector<Triangle> left = collapsed(group, last);
    std::vector<Vec3d> vertices, centres;
    for (const Vec3f& p : group.positions) vertices.push_back(to_double(p));
    for (const Triangle& t : group.triangles)
      centres.push_back((vertices[t[0]] + vertices[t[1]] + vertices[t[2]]) * (1.0 / 3));
    const double of_vertices = farthest(vertices, group, left),
                 of_centres = farthest(centres, group, left);
    of_centres_alone += of_centres > 1.01 * of_vertices;
    const double error = collapse_error(group, last, left);
    EXPECT_GE(error, std::max(of_vertices, of_centres) * (1 - 1e-9)) << "round " << round;
    EXPECT_LE(error, 2 * std::max(of_vertices, of_centres)) << "round " << round;
  }
  EXPECT_GT(of_centres_alone, 0);
}

}  // namespace
}  // namespace isobrick::test
