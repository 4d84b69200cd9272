#include <gtest/gtest.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <numbers>

#include <isobrick/error.h>
#include "surface/cap.h"
#include "tests/simd_levels.h"
#include "tests/surface/kept_triangles.h"
#include "tests/surface/mesh_topology.h"

// Capped surfaces: closed at the border of the volume or region and around NaN.

namespace isobrick::testing {
namespace {

template <class T>
class CapOf : public ::testing::Test {};
using Types = ::testing::Types<std::uint8_t, std::int8_t, std::uint16_t, std::int16_t,
                               std::uint32_t, std::int32_t, float, double>;
TYPED_TEST_SUITE(CapOf, Types);

/// Noise up to the border. `values` integers only, so that samples equal an isovalue.
template <class T>
Field<T> noise(Int3 extent, double values, unsigned seed) {
  std::mt19937 random(seed);
  return Field<T>(extent, [&](Int3) -> double {
    return std::floor(values * (static_cast<double>(random()) / 4294967296.0));
  });
}

/// Noise with single samples and boxes of NaN.
template <class T>
Field<T> noise_with_nan(Int3 extent, unsigned rare, unsigned seed) {
  Field<T> field = noise<T>(extent, 7, seed);
  std::mt19937 random(seed + 1);
  constexpr T nan = std::numeric_limits<T>::quiet_NaN();
  for (T& v : field.samples)
    if (random() % rare == 0) v = nan;
  for (int i = 0; i < 6; ++i) {
    Int3 lo;
    for (int axis = 0; axis < 3; ++axis)
      lo[axis] = static_cast<Index>(random()) % field.extent[axis];
    for_each_point(intersect({lo, lo + Int3{9, 7, 11}}, field.box()),
                   [&](Int3 p) { field.at(p) = nan; });
  }
  return field;
}

double volume_of(const Mesh& mesh) {
  double sum = 0;
  for (const Triangle& t : mesh.triangles) {
    const auto at = [&](std::size_t corner, int axis) {
      return static_cast<double>(mesh.positions[t[corner]][axis]);
    };
    for (int a = 0; a < 3; ++a) {
      const int b = (a + 1) % 3, c = (a + 2) % 3;
      sum += at(0, a) * (at(1, b) * at(2, c) - at(1, c) * at(2, b));
    }
  }
  return sum / 6;
}

bool lies_on_border(const std::array<float, 9>& triangle, Box3 region) {
  for (std::size_t axis = 0; axis < 3; ++axis)
    for (const Index side :
         {region.lo[static_cast<int>(axis)], region.hi[static_cast<int>(axis)] - 1}) {
      bool all = true;
      for (std::size_t corner = 0; corner < 3; ++corner)
        all = all && triangle[3 * corner + axis] == static_cast<float>(side);
      if (all) return true;
    }
  return false;
}

/// The triangles that the cap adds to the uncapped mesh, none of whose triangles may lack.
template <class T>
std::multiset<std::array<float, 9>> cap_triangles(const Field<T>& field, Request request) {
  request.cap = true;
  auto added = soup(extract(field, request));
  request.cap = false;
  for (const auto& triangle : soup(extract(field, request))) {
    const auto found = added.find(triangle);
    if (found == added.end()) {
      ADD_FAILURE() << "a triangle of the uncapped mesh is not there";
      return {};
    }
    added.erase(found);
  }
  return added;
}

constexpr Topology kTopologies[] = {Topology::consistent, Topology::trilinear};
constexpr Inside kInsides[] = {Inside::above, Inside::below};

TYPED_TEST(CapOf, NoiseIsAClosedManifold) {
  const auto field = noise<TypeParam>({66, 34, 20}, 7, 1);
  for (const Topology topology : kTopologies)
    for (const Inside inside : kInsides) {
      const Request request{.isovalue = 3, .inside = inside, .topology = topology, .cap = true};
      const Mesh mesh = extract(field, request);
      EXPECT_TRUE(is_closed_manifold(mesh));
      EXPECT_EQ(unused_vertices(mesh), 0u);
      const auto caps = cap_triangles(field, request);
      EXPECT_GT(caps.size(), 500u);
      for (const auto& triangle : caps) ASSERT_TRUE(lies_on_border(triangle, field.box()));
    }
}

TYPED_TEST(CapOf, RegionsAreClosed) {
  const auto field = noise<TypeParam>({70, 50, 40}, 7, 2);
  for (const Box3 roi : {Box3{{3, 5, 1}, {69, 40, 39}}, Box3{{32, 16, 0}, {65, 33, 40}},
                         Box3{{31, 31, 31}, {34, 34, 34}}, Box3{{0, 47, 3}, {70, 49, 40}},
                         Box3{{33, 0, 0}, {34, 50, 40}}, Box3{{16, 16, 16}, {18, 18, 18}}}) {
    const Request request{.isovalue = 3.5, .roi = roi, .cap = true};
    EXPECT_TRUE(is_closed_manifold(extract(field, request)));
    for (const auto& triangle : cap_triangles(field, request))
      ASSERT_TRUE(lies_on_border(triangle, roi));
  }
}

TYPED_TEST(CapOf, InsideAndOutsideMakeTheBox) {
  const auto field = noise<TypeParam>({40, 37, 35}, 7, 3);
  for (const Topology topology : kTopologies)
    for (const double isovalue : {3.0, 2.25}) {
      Request request{.isovalue = isovalue, .topology = topology, .cap = true};
      const double above = volume_of(extract(field, request));
      request.inside = Inside::below;
      const double below = volume_of(extract(field, request));
      EXPECT_GT(above, 1000);
      EXPECT_GT(below, 1000);
      EXPECT_NEAR(above + below, 39.0 * 36 * 34, 0.05);
    }
}

TYPED_TEST(CapOf, WhereAllIsInsideTheMeshIsTheBox) {
  const auto field = noise<TypeParam>({67, 35, 34}, 7, 4);
  const auto expect_box = [&](const Request& request) {
    const Mesh mesh = extract(field, request);
    EXPECT_TRUE(is_closed_manifold(mesh));
    EXPECT_EQ(mesh.positions.size(), 67u * 35 * 34 - 65 * 33 * 32);
    EXPECT_EQ(mesh.triangles.size(), 4u * (66 * 34 + 66 * 33 + 34 * 33));
    EXPECT_EQ(volume_of(mesh), 66.0 * 34 * 33);
  };
  for (const double isovalue : {0.0, -1e9, -std::numeric_limits<double>::infinity()})
    expect_box({.isovalue = isovalue, .cap = true});
  for (const double isovalue : {7.0, 1e30, std::numeric_limits<double>::infinity()})
    expect_box({.isovalue = isovalue, .inside = Inside::below, .cap = true});
  EXPECT_EQ(extract(field, {.isovalue = 1e30, .cap = true}).triangles.size(), 0u);
  EXPECT_EQ(extract(field, {.isovalue = 0, .inside = Inside::below, .cap = true}).triangles.size(),
            0u);
}

// The largest sample of a type is below an isovalue beyond the type.
TYPED_TEST(CapOf, TheLargestSampleIsBelowALargerIsovalue) {
  Field<TypeParam> field({5, 6, 7});
  for (TypeParam& v : field.samples) v = std::numeric_limits<TypeParam>::max();
  const double infinity = std::numeric_limits<double>::infinity();
  EXPECT_EQ(volume_of(extract(field, {.isovalue = infinity, .inside = Inside::below, .cap = true})),
            4.0 * 5 * 6);
}

TYPED_TEST(CapOf, BricksBatchesThreadsAndProcessorsNeverShow) {
  const auto field = noise<TypeParam>({68, 40, 35}, 7, 5);
  for (const Topology topology : kTopologies) {
    Request request{.isovalue = 4, .normals = true, .topology = topology, .cap = true};
    const Mesh expected = extract(field, request);
    for (const Int3 brick : {Int3{16, 16, 16}, Int3{17, 40, 23}}) {
      request.brick = brick;
      EXPECT_EQ(extract(field, request), expected);
    }
    for (const int threads : {1, 2, 8})
      tbb::task_arena(threads).execute([&] { EXPECT_EQ(extract(field, request), expected); });
    for (const std::size_t batch : {1u, 3u, 11u}) {
      request.batch = batch;
      request.workspaces = batch + 1;
      EXPECT_EQ(extract(field, request), expected);
    }
    for (const SimdLevel level : simd_levels()) {
      const SimdLevelLimit limit(level);
      EXPECT_EQ(extract(field, request), expected) << static_cast<int>(level);
    }
  }
}

TYPED_TEST(CapOf, ChunksStandAlone) {
  const auto field = noise<TypeParam>({70, 40, 37}, 7, 6);
  Request request{.isovalue = 2, .cap = true};
  const Mesh welded = extract(field, request);
  request.indexing = Indexing::chunk_local;
  const Mesh local = extract(field, request);
  EXPECT_EQ(soup(local), soup(welded));
  EXPECT_EQ(unused_vertices(local), 0u);
}

template <class T>
class CapAroundNanOf : public ::testing::Test {};
using Floats = ::testing::Types<float, double>;
TYPED_TEST_SUITE(CapAroundNanOf, Floats);

TYPED_TEST(CapAroundNanOf, HolesAreClosed) {
  for (const unsigned rare : {30u, 300u, 10000u}) {
    const auto field = noise_with_nan<TypeParam>({50, 37, 36}, rare, 7 + rare);
    for (const Topology topology : kTopologies)
      for (const Inside inside : kInsides) {
        Request request{.isovalue = 3, .inside = inside, .topology = topology, .cap = true};
        const Mesh mesh = extract(field, request);
        EXPECT_TRUE(sides_balance(mesh));
        EXPECT_EQ(unused_vertices(mesh), 0u);
        EXPECT_FALSE(cap_triangles(field, request).empty());
        request.roi = {{5, 3, 2}, {46, 36, 35}};
        EXPECT_TRUE(sides_balance(extract(field, request)));
      }
  }
}

TYPED_TEST(CapAroundNanOf, InsideAndOutsideMakeTheCellsThatExist) {
  const auto field = noise_with_nan<TypeParam>({45, 37, 35}, 200, 8);
  double cells = 0;
  for_each_point({{0, 0, 0}, field.extent - Int3{1, 1, 1}}, [&](Int3 cell) {
    bool exists = true;
    for (int c = 0; c < 8; ++c)
      exists = exists && !std::isnan(field.at(cell + Int3{c & 1, c >> 1 & 1, c >> 2}));
    cells += exists;
  });
  for (const Topology topology : kTopologies) {
    Request request{.isovalue = 2.25, .topology = topology, .cap = true};
    const double above = volume_of(extract(field, request));
    request.inside = Inside::below;
    EXPECT_NEAR(above + volume_of(extract(field, request)), cells, 0.05);
  }
}

TYPED_TEST(CapAroundNanOf, SamplesShareOneVertex) {
  auto field = noise_with_nan<TypeParam>({70, 66, 40}, 100, 9);
  for (TypeParam& v : field.samples)
    if (!std::isnan(v)) v += TypeParam(0.25);  // no vertex of an edge lies on a sample
  const Mesh mesh = extract(field, {.isovalue = 3, .cap = true});
  EXPECT_EQ(repeated_positions(mesh), 0u);
  EXPECT_TRUE(sides_balance(mesh));
}

TYPED_TEST(CapAroundNanOf, BricksBatchesAndThreadsNeverShow) {
  const auto field = noise_with_nan<TypeParam>({68, 45, 35}, 60, 10);
  Request request{.isovalue = 4, .normals = true, .cap = true};
  const Mesh expected = extract(field, request);
  for (const std::size_t batch : {1u, 3u}) {
    request.batch = batch;
    request.workspaces = batch;
    request.brick = {17, 40, 23};
    EXPECT_EQ(extract(field, request), expected);
    tbb::task_arena(8).execute([&] { EXPECT_EQ(extract(field, request), expected); });
  }
  request.indexing = Indexing::chunk_local;
  EXPECT_EQ(soup(extract(field, request)), soup(expected));
}

// Where eight tiles meet, whichever of them has cells there.
TEST(Cap, TheCornerOfEightTiles) {
  for (unsigned seed = 0; seed < 30; ++seed) {
    std::mt19937 random(seed);
    const unsigned rare = 2 + seed % 5;
    const Box3 core{{30, 30, 30}, {35, 35, 35}};
    const Field<float> field({40, 38, 37}, [&](Int3 p) -> double {
      if (core.contains(p) && random() % rare == 0) return std::nan("");
      return random() % 4 == 0 ? 0 : 1;
    });
    for (const Inside inside : kInsides) {
      const Mesh mesh = extract(
          field, {.isovalue = 0.5, .inside = inside, .normals = true, .batch = 1, .cap = true});
      ASSERT_TRUE(sides_balance(mesh)) << seed;
      for (const Vec3f& n : mesh.normals)
        ASSERT_NEAR(n.x * n.x + n.y * n.y + n.z * n.z, 1, 1e-5) << seed;
    }
  }
}

TEST(Cap, OfAHalfSpace) {
  const Field<float> field({40, 35, 37}, [](Int3 p) { return static_cast<double>(p.x); });
  const Request above{.isovalue = 10.25, .cap = true};
  EXPECT_NEAR(volume_of(extract(field, above)), (39 - 10.25) * 34 * 36, 1e-2);
  const Request below{.isovalue = 10.25, .inside = Inside::below, .cap = true};
  EXPECT_NEAR(volume_of(extract(field, below)), 10.25 * 34 * 36, 1e-2);
  EXPECT_TRUE(is_closed_manifold(extract(field, above)));
}

Field<float> sphere(Int3 extent, Vec3d centre, double radius) {
  return Field<float>(extent, [&](Int3 p) {
    const double x = static_cast<double>(p.x) - centre.x, y = static_cast<double>(p.y) - centre.y,
                 z = static_cast<double>(p.z) - centre.z;
    return radius - std::sqrt(x * x + y * y + z * z);
  });
}

TEST(Cap, OfASphereThatTheBorderCuts) {
  // The height of the part beyond x = 0. No sample of that plane lies on the sphere.
  const double radius = 20, height = 8.5;
  const auto field = sphere({60, 60, 60}, {radius - height, 30.1, 29.8}, radius);
  const Mesh mesh = extract(field, {.normals = true, .cap = true});
  EXPECT_TRUE(is_closed_manifold(mesh));
  const double expected = std::numbers::pi * (4.0 / 3 * radius * radius * radius -
                                              height * height * (radius - height / 3));
  EXPECT_NEAR(volume_of(mesh), expected, 0.003 * expected);
  std::size_t on_samples = 0;
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    const Vec3f p = mesh.positions[i];
    if (p.x != 0 || p.y != std::floor(p.y) || p.z != std::floor(p.z)) continue;
    EXPECT_EQ(mesh.normals[i], (Vec3f{-1, 0, 0}));
    ++on_samples;
  }
  EXPECT_NEAR(static_cast<double>(on_samples),
              std::numbers::pi * (radius * radius - (radius - height) * (radius - height)), 30);
}

TEST(Cap, NormalsAtEdgesAndCornersAreTheSumOfTheFaces) {
  Field<std::uint8_t> field({4, 4, 4});
  Transform transform;
  transform.spacing = {1, 2, 0.5};
  const Mesh mesh =
      extract(field, {.isovalue = 0, .normals = true, .transform = transform, .cap = true});
  ASSERT_EQ(mesh.positions.size(), 64u - 8);
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    Vec3d sum{};
    double length = 0;
    for (int axis = 0; axis < 3; ++axis) {
      const double p = static_cast<double>(mesh.positions[i][axis]) / transform.spacing[axis];
      sum[axis] = p == 0 ? -1 : p == 3 ? 1 : 0;
      length += sum[axis] * sum[axis];
    }
    // As many faces at an edge's or corner's sample lie across each axis.
    for (int axis = 0; axis < 3; ++axis)
      EXPECT_NEAR(mesh.normals[i][axis], sum[axis] / std::sqrt(length), 1e-6);
  }
}

TEST(Cap, LeftHandedVolumesFaceOutwards) {
  const auto field = noise<float>({40, 36, 35}, 7, 11);
  for (const Inside inside : kInsides) {
    Request request{.isovalue = 2.5, .inside = inside, .normals = true, .cap = true};
    const Mesh expected = extract(field, request);
    request.transform.spacing.x = -1;
    Mesh mesh = extract(field, request);
    EXPECT_TRUE(is_closed_manifold(mesh));
    EXPECT_NEAR(volume_of(mesh), volume_of(expected), 1e-2);
    EXPECT_GT(volume_of(mesh), 1000);
    for (std::size_t i = 0; i < mesh.normals.size(); ++i)
      ASSERT_EQ(mesh.normals[i].x, -expected.normals[i].x);
  }
}

TEST(Cap, AmbiguousFacesFollowTheTopology) {
  Field<float> field({2, 2, 2});
  field.at({0, 0, 0}) = 3;
  field.at({1, 1, 0}) = 3;
  const double isovalue = 1;
  for (const Topology topology : kTopologies) {
    // The decider joins the inside: 2 · 2 ≥ 1 · 1. Less than that and it does not.
    const Mesh joined = extract(field, {.isovalue = isovalue, .topology = topology, .cap = true});
    EXPECT_EQ(betti_of(joined).b0, 1);
    const Mesh apart = extract(field, {.isovalue = 2, .topology = topology, .cap = true});
    EXPECT_EQ(betti_of(apart).b0, topology == Topology::trilinear ? 2 : 1);
    EXPECT_TRUE(is_closed_manifold(joined));
    EXPECT_TRUE(is_closed_manifold(apart));
  }
}

TEST(Cap, PolygonsCoverTheirPartOfTheFace) {
  const auto place = [](int corner) -> std::array<double, 2> {
    constexpr double at[8][2] = {{0, 0},  {1, 0},  {1, 1},  {0, 1},
                                 {.5, 0}, {1, .5}, {.5, 1}, {0, .5}};
    return {at[corner][0], at[corner][1]};
  };
  for (std::size_t index = 0; index < 32; ++index) {
    const int corners = std::popcount(index & 15);
    const bool apart = index == 16 + 5 || index == 16 + 10;
    const bool ambiguous = index % 16 == 5 || index % 16 == 10;
    const double expected = apart          ? 0.25
                            : ambiguous    ? 0.75
                            : corners == 1 ? 0.125
                            : corners == 2 ? 0.5
                            : corners == 3 ? 0.875
                            : corners == 4 ? 1
                                           : 0;
    double area = 0;
    const CapPolygon& polygon = kCapPolygons[index];
    EXPECT_LE(polygon.triangles, kMaxFaceTriangles);
    for (std::size_t t = 0; t < polygon.triangles; ++t) {
      const auto a = place(polygon.corners[3 * t]), b = place(polygon.corners[3 * t + 1]),
                 c = place(polygon.corners[3 * t + 2]);
      const double twice = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
      EXPECT_GT(twice, 0) << index;
      area += twice / 2;
    }
    EXPECT_EQ(area, expected) << index;
  }
}

// The budget of an extraction counts on these for any input.
TEST(Cap, TakesNoMoreThanItsBounds) {
  const auto count = [](const Field<float>& field, Box3 roi, bool may_have_nan) {
    const Lattice lattice{field.extent, {64, 64, 64}, ScalarType::f32};
    SurfaceOptions options{.isovalue = 0, .cap = true, .roi = roi, .may_have_nan = may_have_nan};
    const CapBounds bounds = cap_bounds(options);
    const CpuExtractor capped(lattice, options, {});
    options.cap = false;
    const CpuExtractor open(lattice, options, {});
    const DenseBricks bricks(lattice, field.samples.data());
    for_each_point({{0, 0, 0}, lattice.tiles()}, [&](Int3 tile) {
      const MeshSize with = capped.count({tile, 0xff}, bricks),
                     without = open.count({tile, 0xff}, bricks);
      EXPECT_LE(with.vertices - without.vertices, bounds.vertices);
      EXPECT_LE(with.triangles - without.triangles, kMaxFaceTriangles * bounds.faces);
    });
  };
  const Field<float> ones({70, 40, 33}, [](Int3) { return 1.0; });
  count(ones, ones.box(), false);
  count(ones, {{0, 5, 1}, {33, 7, 3}}, false);
  const Field<float> board(
      {40, 40, 40}, [](Int3 p) { return p.x % 4 + p.y % 4 + p.z % 4 == 0 ? std::nan("") : 1.0; });
  count(board, board.box(), true);
}

}  // namespace
}  // namespace isobrick::testing
