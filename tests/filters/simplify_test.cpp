#include <isobrick/mesh_filters.h>

#include <gtest/gtest.h>

#include <limits>
#include <set>

#include <isobrick/error.h>
#include "core/vectors.h"
#include "tests/filters/far_triangles.h"
#include "tests/filters/filter_fixture.h"

namespace isobrick::test {
namespace {

/// A bumpy sphere of several groups.
Mesh bumpy(Index n = 150, bool normals = false) {
  return surface_of(
      n, -1.3, 1.3,
      [](double x, double y, double z) {
        return 1 + 0.05 * std::sin(12 * x) * std::sin(9 * y + 1) * std::sin(10 * z + 2) -
               std::hypot(x, y, z);
      },
      normals);
}

Mesh torus(Index n = 60) {
  return surface_of(n, -1.5, 1.5, [](double x, double y, double z) {
    return 0.4 - std::hypot(std::hypot(x, y) - 0.9, z);
  });
}

/// The part of a mesh's area that is turned over against the direction from the centre: of a
/// surface around the centre.
double turned_over(const Mesh& mesh) {
  double turned = 0, all = 0;
  for (const Triangle& t : mesh.triangles) {
    const Vec3d a = to_double(mesh.positions[t[0]]), b = to_double(mesh.positions[t[1]]),
                c = to_double(mesh.positions[t[2]]);
    const Vec3d product = cross(b - a, c - a);
    all += length(product);
    if (dot(product, a + b + c) <= 0) turned += length(product);
  }
  return turned / all;
}

/// The part of the triangles with a first side shorter than `edge`.
double short_part(const Mesh& mesh, double edge) {
  const auto is_short = [&](const Triangle& t) {
    return length(to_double(mesh.positions[t[0]] - mesh.positions[t[1]])) < edge;
  };
  return static_cast<double>(std::ranges::count_if(mesh.triangles, is_short)) /
         static_cast<double>(mesh.triangles.size());
}

/// Whether both meshes, whose vertices are part of those of `a`, are within a distance.
bool vertices_are_near(const Mesh& a, const Mesh& b, double distance) {
  std::vector<Vec3f> positions(a.positions.begin(), a.positions.end());
  const auto first = static_cast<std::uint32_t>(positions.size());
  positions.insert(positions.end(), b.positions.begin(), b.positions.end());
  std::vector<Triangle> from(a.triangles.begin(), a.triangles.end()), to;
  for (const Triangle& t : b.triangles) to.push_back({t[0] + first, t[1] + first, t[2] + first});
  return far_triangles(positions, from, to, distance).empty();
}

bool is_part_of(const Mesh& part, const Mesh& whole) {
  std::set<std::tuple<float, float, float>> places;
  for (const Vec3f& p : whole.positions) places.emplace(p.x, p.y, p.z);
  return std::ranges::all_of(part.positions, [&](const Vec3f& p) {
    return places.contains({p.x, p.y, p.z});
  });
}

TEST(Simplify, ReachesItsGoal) {
  const Mesh mesh = bumpy();
  ASSERT_GT(mesh.triangles.size(), 60000U);
  for (const double ratio : {0.5, 0.1, 0.02}) {
    const Filtered simple = filtered(mesh, {.simplify_ratio = ratio, .measure = true});
    const double expected = ratio * static_cast<double>(mesh.triangles.size());
    EXPECT_NEAR(static_cast<double>(simple.size.triangles), expected, 2) << ratio;
    EXPECT_TRUE(simple.measure->is_closed()) << ratio;
    EXPECT_EQ(simple.measure->euler_number, 2) << ratio;
    EXPECT_EQ(simple.measure->vertices, simple.mesh.positions.size()) << ratio;
    EXPECT_TRUE(is_part_of(simple.mesh, mesh));
    EXPECT_LT(turned_over(simple.mesh), 0.002) << ratio;
    EXPECT_NEAR(*simple.measure->volume, *measure(mesh).volume, 0.01 * *measure(mesh).volume);
  }
  EXPECT_NEAR(static_cast<double>(filtered(mesh, {.simplify_triangles = 5000}).size.triangles),
              5000, 2);
}

TEST(Simplify, SeveralGroupsHaveNoSeam) {
  const Mesh mesh = bumpy(300);
  ASSERT_GT(mesh.triangles.size(), 300000U);
  const Filtered simple = filtered(mesh, {.simplify_ratio = 0.05, .measure = true});
  const double expected = 0.05 * static_cast<double>(mesh.triangles.size());
  EXPECT_NEAR(static_cast<double>(simple.size.triangles), expected, 2);
  EXPECT_TRUE(simple.measure->is_closed());
  EXPECT_EQ(simple.measure->euler_number, 2);
  // Where groups met there is no chain of the short sides of the original.
  const double in_one_group =
      short_part(filtered(bumpy(150), {.simplify_ratio = 0.05}).mesh, 2.6 / 149);
  EXPECT_LT(short_part(simple.mesh, 2.6 / 299), in_one_group + 0.005);
}

TEST(Simplify, KeepsToTheError) {
  const Mesh mesh = bumpy(120);
  std::size_t before = mesh.triangles.size();
  for (const double error : {0.0005, 0.002, 0.01}) {
    const Mesh simple = filtered(mesh, {.max_error = error}).mesh;
    EXPECT_TRUE(vertices_are_near(mesh, simple, 1.0001 * error)) << error;
    EXPECT_LT(simple.triangles.size(), before) << error;
    EXPECT_EQ(open_sides_of(simple), 0U);
    before = simple.triangles.size();
  }
  // A goal that the error does not permit is missed.
  const Filtered limited = filtered(mesh, {.simplify_ratio = 0.001, .max_error = 0.002});
  EXPECT_TRUE(vertices_are_near(mesh, limited.mesh, 1.0001 * 0.002));
  EXPECT_GT(limited.size.triangles, mesh.triangles.size() / 500);
  // One that it does is not exceeded.
  const Filtered reached = filtered(mesh, {.simplify_ratio = 0.5, .max_error = 0.01});
  EXPECT_NEAR(static_cast<double>(reached.size.triangles),
              0.5 * static_cast<double>(mesh.triangles.size()), 2);
}

TEST(Simplify, HandlesAndComponentsStay) {
  const MeshMeasure ring = *filtered(torus(), {.simplify_ratio = 0.2, .measure = true}).measure;
  EXPECT_TRUE(ring.is_closed());
  EXPECT_EQ(ring.euler_number, 0);
  const Mesh balls = debris();
  const MeshMeasure before = measure(balls),
                    after = *filtered(balls, {.simplify_ratio = 0.5, .measure = true}).measure;
  EXPECT_EQ(after.components, before.components);
  EXPECT_EQ(after.euler_number, before.euler_number);
  EXPECT_EQ(after.open_sides, before.open_sides);  // where the border cuts balls
}

TEST(Simplify, BordersStayWhereTheyAre) {
  const Mesh mesh = surface_of(60, 0, 1, [](double x, double y, double z) {
    return 0.5 + 0.1 * std::sin(9 * x) * std::cos(7 * y) - z;
  });
  const MeshMeasure before = measure(mesh);
  ASSERT_GT(before.open_sides, 0U);
  const MeshMeasure after = *filtered(mesh, {.simplify_ratio = 0.2, .measure = true}).measure;
  EXPECT_EQ(after.open_sides, before.open_sides);
  EXPECT_EQ(after.euler_number, before.euler_number);
  EXPECT_EQ(after.bounds->lo, before.bounds->lo);
  EXPECT_EQ(after.bounds->hi, before.bounds->hi);
}

TEST(Simplify, ChunksMemoryAndThreadsNeverShow) {
  const Mesh mesh = bumpy(260, true);
  const MeshFilterOptions options{.simplify_ratio = 0.1, .threads = 1};
  const Mesh expected = filtered(mesh, options).mesh;
  EXPECT_EQ(expected.normals.size(), expected.positions.size());
  for (const std::size_t chunk : {std::size_t{777}, std::size_t{50000}})
    EXPECT_TRUE(same(filtered(mesh, options, chunk).mesh, expected)) << chunk;
  MeshFilterOptions other = options;
  other.memory = 1 << 20;
  other.threads = 3;
  EXPECT_TRUE(same(filtered(mesh, other).mesh, expected));
}

TEST(Simplify, NothingToDo) {
  const Mesh mesh = sphere(30, 1, true);
  EXPECT_TRUE(same(filtered(mesh, {.simplify_ratio = 1}).mesh, mesh));
  EXPECT_TRUE(same(filtered(mesh, {.simplify_triangles = 1000000}).mesh, mesh));
  EXPECT_TRUE(filtered(Mesh(), {.simplify_ratio = 0.5}).mesh.triangles.empty());
  EXPECT_TRUE(filtered(Mesh(), {.max_error = 1}).mesh.triangles.empty());
}

TEST(Simplify, RefusesWhatMakesNoSense) {
  Mesh mesh;
  MemorySink sink(mesh);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const double ratio : {0.0, -1.0, 1.5, nan})
    EXPECT_THROW(MeshFilter(sink, {.simplify_ratio = ratio}), UsageError) << ratio;
  for (const double error : {-1.0, nan, std::numeric_limits<double>::infinity()})
    EXPECT_THROW(MeshFilter(sink, {.max_error = error}), UsageError) << error;
}

}  // namespace
}  // namespace isobrick::test
