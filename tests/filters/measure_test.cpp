#include <isobrick/mesh_filters.h>

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include <isobrick/error.h>
#include "filters/measure_stage.h"
#include "tests/filters/filter_fixture.h"

namespace isobrick::test {
namespace {

constexpr double kPi = std::numbers::pi;

/// The box [0, x] × [0, y] × [0, z] of twelve triangles, at `corner`.
Mesh box(Vec3f size, Vec3f corner = {}) {
  Mesh mesh;
  mesh.positions.resize(8);
  for (std::uint32_t i = 0; i < 8; ++i)
    mesh.positions[i] = corner + Vec3f{i & 1 ? size.x : 0, i & 2 ? size.y : 0, i & 4 ? size.z : 0};
  const Triangle triangles[] = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                                {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  mesh.triangles.resize(12);
  std::ranges::copy(triangles, mesh.triangles.begin());
  return mesh;
}

TEST(Measure, OfABoxIsExact) {
  const MeshMeasure m = measure(box({2, 3, 4}));
  EXPECT_EQ(m.vertices, 8u);
  EXPECT_EQ(m.triangles, 12u);
  EXPECT_EQ(m.components, 1u);
  EXPECT_EQ(m.euler_number, 2);
  EXPECT_TRUE(m.is_closed());
  EXPECT_DOUBLE_EQ(m.area, 52);
  EXPECT_DOUBLE_EQ(m.volume.value(), 24);
  EXPECT_EQ(m.bounds->lo, (Vec3d{0, 0, 0}));
  EXPECT_EQ(m.bounds->hi, (Vec3d{2, 3, 4}));
}

// Coordinates of a map: without a local origin the volume would be lost in rounding.
TEST(Measure, OfABoxFarFromTheOriginIsExact) {
  const MeshMeasure m = measure(box({2, 3, 4}, {4194304, -8388608, 2097152}));
  EXPECT_DOUBLE_EQ(m.volume.value(), 24);
  EXPECT_DOUBLE_EQ(m.area, 52);
}

TEST(Measure, OfAMeshInsideOutHasANegativeVolume) {
  Mesh mesh = box({1, 1, 1});
  for (Triangle& t : mesh.triangles) std::swap(t[0], t[1]);
  const MeshMeasure m = measure(mesh);
  EXPECT_DOUBLE_EQ(m.volume.value(), -1);
  EXPECT_TRUE(m.is_closed());
}

TEST(Measure, OfAnOpenMeshHasNoVolume) {
  Mesh mesh = box({1, 1, 1});
  mesh.triangles.resize(10);  // without the side x = 1
  const MeshMeasure m = measure(mesh);
  EXPECT_EQ(m.open_sides, 4u);
  EXPECT_FALSE(m.volume);
  EXPECT_DOUBLE_EQ(m.area, 5);
  EXPECT_EQ(m.euler_number, 1);  // a disc
}

TEST(Measure, OfATriangleThatIsReversedIsOpen) {
  Mesh mesh = box({1, 1, 1});
  std::swap(mesh.triangles[3][0], mesh.triangles[3][1]);
  EXPECT_EQ(measure(mesh).open_sides, 6u);
}

TEST(Measure, OfNothing) {
  const MeshMeasure m = measure(Mesh());
  EXPECT_EQ(m.components, 0u);
  EXPECT_EQ(m.euler_number, 0);
  EXPECT_EQ(m.area, 0);
  EXPECT_EQ(m.volume.value(), 0);
  EXPECT_TRUE(m.is_closed());
  EXPECT_FALSE(m.bounds);
}

TEST(Measure, LeavesOutVerticesThatNoTriangleNames) {
  Mesh mesh = box({1, 1, 1});
  mesh.positions.resize(9);
  mesh.positions[8] = {0.5F, 0.5F, 0.5F};
  const MeshMeasure m = measure(mesh);
  EXPECT_EQ(m.vertices, 8u);
  EXPECT_EQ(m.components, 1u);
  EXPECT_EQ(m.euler_number, 2);
}

TEST(Measure, RefusesNumbersOfNoVertex) {
  Mesh mesh = box({1, 1, 1});
  mesh.triangles[5][1] = 8;
  EXPECT_THROW((void)measure(mesh), UsageError);
}

TEST(Measure, OfASphere) {
  const MeshMeasure m = measure(sphere(80));
  EXPECT_NEAR(m.area, 4 * kPi, 0.01 * 4 * kPi);
  EXPECT_NEAR(m.volume.value(), 4 * kPi / 3, 0.005 * 4 * kPi / 3);
  EXPECT_EQ(m.components, 1u);
  EXPECT_EQ(m.euler_number, 2);
  EXPECT_EQ(m.open_sides, 0u);
  EXPECT_NEAR(m.bounds->hi.z, 1.03, 0.01);
}

TEST(Measure, OfATorus) {
  const MeshMeasure m = measure(surface_of(96, -1.5, 1.5, [](double x, double y, double z) {
    return 0.35 - std::hypot(std::hypot(x, y) - 0.9, z);
  }));
  EXPECT_NEAR(m.area, 4 * kPi * kPi * 0.9 * 0.35, 0.01 * m.area);
  EXPECT_NEAR(m.volume.value(), 2 * kPi * kPi * 0.9 * 0.35 * 0.35, 0.01 * m.volume.value());
  EXPECT_EQ(m.euler_number, 0);
  EXPECT_EQ(m.components, 1u);
}

TEST(Measure, OfTwoSpheresThatJoinAndThatDoNot) {
  const auto two = [](double distance) {
    return measure(surface_of(60, -2.5, 2.5, [&](double x, double y, double z) {
      return std::max(ball(x, y, z, {-distance / 2, 0, 0}, 1),
                      ball(x, y, z, {distance / 2, 0, 0}, 1));
    }));
  };
  const MeshMeasure apart = two(2.6), joined = two(1);
  EXPECT_EQ(apart.components, 2u);
  EXPECT_EQ(apart.euler_number, 4);
  EXPECT_NEAR(apart.volume.value(), 8 * kPi / 3, 0.1);
  EXPECT_EQ(joined.components, 1u);
  EXPECT_EQ(joined.euler_number, 2);
  // Two balls less the lens that they share.
  const double lens = kPi * (4 + 1) * std::pow(2 - 1, 2) / 12;
  EXPECT_NEAR(joined.volume.value(), 8 * kPi / 3 - lens, 0.1);
}

TEST(Measure, AgreesWithThePlainCountOfAnOpenSurface) {
  const Mesh mesh = debris();
  const MeshMeasure m = measure(mesh);
  EXPECT_EQ(m.open_sides, open_sides_of(mesh));
  EXPECT_GT(m.open_sides, 0u);
  std::vector<std::uint32_t> root = components_of(mesh);
  std::uint64_t components = 0;
  for (std::uint32_t v = 0; v < root.size(); ++v) components += root[v] == v;
  EXPECT_EQ(m.components, components);
  EXPECT_GT(components, 100u);
}

void expect_equal(const MeshMeasure& a, const MeshMeasure& b) {
  EXPECT_EQ(a.vertices, b.vertices);
  EXPECT_EQ(a.triangles, b.triangles);
  EXPECT_EQ(a.components, b.components);
  EXPECT_EQ(a.open_sides, b.open_sides);
  EXPECT_EQ(a.euler_number, b.euler_number);
  EXPECT_EQ(a.area, b.area);  // to the bit
  EXPECT_EQ(a.volume, b.volume);
  EXPECT_EQ(a.bounds->lo, b.bounds->lo);
  EXPECT_EQ(a.bounds->hi, b.bounds->hi);
}

TEST(Measure, DependsOnNeitherChunksNorMemory) {
  for (const Mesh& mesh : {debris(), sphere(50)}) {
    const MeshMeasure expected = measure(mesh);
    for (const std::uint64_t memory : {0u, 1u << 20, 1u << 28})
      for (const std::size_t chunk : {7u, 1000u, 1u << 20}) {
        const Filtered result = filtered(mesh, {.measure = true, .memory = memory}, chunk);
        expect_equal(*result.measure, expected);
        EXPECT_TRUE(same(result.mesh, mesh)) << "the mesh changed on its way";
      }
  }
}

TEST(CompensatedSum, KeepsSmallTermsBesideLargeOnes) {
  CompensatedSum sum;
  sum.add(1e16);
  for (int i = 0; i < 1000; ++i) sum.add(0.125);
  sum.add(-1e16);
  EXPECT_DOUBLE_EQ(sum.value(), 125);
}

}  // namespace
}  // namespace isobrick::test
