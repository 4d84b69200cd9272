#include <gtest/gtest.h>
#include <tbb/task_arena.h>

#include <cmath>
#include <limits>

#include "tests/simd_levels.h"
#include "tests/surface/kept_triangles.h"
#include "tests/surface/mesh_topology.h"

// Topology::trilinear in meshes of several tiles, with every other option.

namespace isobrick::testing {
namespace {

constexpr Topology kTrilinear = Topology::trilinear;

template <class T>
class TopologyOf : public ::testing::Test {};
using Types = ::testing::Types<std::uint8_t, std::int8_t, std::uint16_t, std::int16_t,
                               std::uint32_t, std::int32_t, float, double>;
TYPED_TEST_SUITE(TopologyOf, Types);

/// Noise of few values, so that samples equal the isovalue.
template <class T>
Field<T> coarse_noise(Int3 extent, double values, unsigned seed) {
  Field<T> field = padded_noise<T>(extent, 0, values, T{0}, seed);
  for (T& v : field.samples) v = static_cast<T>(std::floor(static_cast<double>(v)));
  return field;
}

template <class T>
std::size_t inner_vertices(const Field<T>& field, const Request& request) {
  Request consistent = request;
  consistent.topology = Topology::consistent;
  return extract(field, request).positions.size() - extract(field, consistent).positions.size();
}

TYPED_TEST(TopologyOf, NoiseIsClosedOverTiles) {
  const auto field = padded_noise<TypeParam>({67, 66, 40}, 0, 100, TypeParam{0}, 3);
  const Request request{.isovalue = 50.5, .topology = kTrilinear};
  const Mesh mesh = extract(field, request);
  EXPECT_TRUE(is_closed_manifold(mesh));
  EXPECT_GT(inner_vertices(field, request), 1000u);
}

TYPED_TEST(TopologyOf, BricksBatchesThreadsAndProcessorsNeverShow) {
  const auto field = coarse_noise<TypeParam>({68, 40, 35}, 7, 5);
  for (const bool drop : {false, true}) {
    Request request{
        .isovalue = 4, .normals = true, .drop_degenerate = drop, .topology = kTrilinear};
    const Mesh expected = extract(field, request);
    for (const Int3 brick : {Int3{16, 16, 16}, Int3{128, 128, 128}, Int3{17, 40, 23}}) {
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

TYPED_TEST(TopologyOf, TheOtherInsideIsTheSameSurfaceReversed) {
  const auto field = coarse_noise<TypeParam>({40, 37, 36}, 7, 6);
  for (const bool drop : {false, true}) {
    Request request{
        .isovalue = 4, .normals = true, .drop_degenerate = drop, .topology = kTrilinear};
    const Mesh above = extract(field, request);
    request.inside = Inside::below;
    Mesh below = extract(field, request);
    EXPECT_EQ(below.positions, above.positions);
    for (Triangle& t : below.triangles) std::swap(t[1], t[2]);
    EXPECT_EQ(below.triangles, above.triangles);
    ASSERT_EQ(below.normals.size(), above.normals.size());
    for (std::size_t i = 0; i < above.normals.size(); ++i)
      for (int axis = 0; axis < 3; ++axis)
        ASSERT_EQ(below.normals[i][axis], -above.normals[i][axis]);
  }
}

TYPED_TEST(TopologyOf, DegenerateTrianglesAreLeftOut) {
  const auto field = coarse_noise<TypeParam>({67, 40, 37}, 4, 8);
  Request request{.isovalue = 2, .topology = kTrilinear};
  const Mesh all = extract(field, request);
  EXPECT_TRUE(is_closed_manifold(all));
  request.drop_degenerate = true;
  const Mesh kept = extract(field, request);
  EXPECT_GT(kept.degenerate, 0u);
  EXPECT_EQ(kept.triangles.size() + kept.degenerate, all.triangles.size());
  EXPECT_TRUE(sides_balance(kept));
  EXPECT_EQ(unused_vertices(kept), 0u);
  EXPECT_EQ(repeated_positions(kept), 0u);
}

TYPED_TEST(TopologyOf, UnweldedMeshesHaveTheSameTriangles) {
  const auto field = coarse_noise<TypeParam>({67, 40, 37}, 4, 9);
  for (const bool drop : {false, true}) {
    Request request{.isovalue = 2, .drop_degenerate = drop, .topology = kTrilinear};
    const Mesh welded = extract(field, request);
    request.indexing = Indexing::chunk_local;
    EXPECT_TRUE(soup(extract(field, request)) == soup(welded));
  }
}

TEST(TopologyMesh, WithoutAmbiguousCellsItIsTheOtherMesh) {
  const Field<float> field({70, 66, 40}, [](Int3 p) {
    const double x = static_cast<double>(p.x) - 34.2, y = static_cast<double>(p.y) - 33.1,
                 z = static_cast<double>(p.z) - 19.7;
    return 15 - std::sqrt(x * x + y * y + z * z);
  });
  const Mesh expected = extract(field, {.normals = true});
  EXPECT_EQ(extract(field, {.normals = true, .topology = kTrilinear}), expected);
}

TEST(TopologyMesh, ARegionIsClosedWhereTheVolumeIsAndHasItsTriangles) {
  const auto field = padded_noise<float>({70, 40, 37}, 0, 100, 0.0f, 10);
  const Box3 roi{{3, 5, 2}, {66, 39, 35}};
  Request request{.isovalue = 50.5, .topology = kTrilinear};
  const auto whole = soup(extract(field, request));
  request.roi = roi;
  const auto part = soup(extract(field, request));
  EXPECT_GT(part.size(), 10000u);
  EXPECT_TRUE(std::includes(whole.begin(), whole.end(), part.begin(), part.end()));
}

TEST(TopologyMesh, MirroredAxesTurnTrianglesRound) {
  const auto field = padded_noise<float>({20, 20, 20}, 0, 100, 0.0f, 11);
  Request request{.isovalue = 50.5, .topology = kTrilinear};
  const Mesh right = extract(field, request);
  request.transform.direction[0] = -1;
  Mesh left = extract(field, request);
  EXPECT_TRUE(is_closed_manifold(left));
  for (Triangle& t : left.triangles) std::swap(t[1], t[2]);
  EXPECT_EQ(left.triangles, right.triangles);
}

TEST(TopologyMesh, InnerVerticesLieInTheirCellsAndNormalsAreUnit) {
  const auto field = padded_noise<float>({36, 20, 20}, 0, 100, 0.0f, 12);
  const Request request{.isovalue = 50.5, .normals = true, .topology = kTrilinear};
  const Mesh mesh = extract(field, request);
  std::size_t inner = 0;
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    const Vec3f p = mesh.positions[i], n = mesh.normals[i];
    EXPECT_NEAR(n.x * n.x + n.y * n.y + n.z * n.z, 1, 1e-5);
    int within = 0;
    for (int axis = 0; axis < 3; ++axis) within += p[axis] != std::floor(p[axis]);
    inner += within == 3;
  }
  EXPECT_EQ(inner, inner_vertices(field, request));
}

/// Extremes of a floating-point type beside ordinary samples.
template <class T>
void expect_sound_extremes(double isovalue) {
  const T most = std::numeric_limits<T>::max(), inf = std::numeric_limits<T>::infinity(),
          least = std::numeric_limits<T>::denorm_min();
  const T values[] = {-inf, -most, -1, -least, 0, least, 1, most, inf};
  Field<T> field({20, 20, 20});
  std::mt19937 random(13);
  for_each_point(field.box(), [&](Int3 p) {
    const bool edge = p.x * p.y * p.z == 0 || p.x == 19 || p.y == 19 || p.z == 19;
    field.at(p) = edge ? -inf : values[random() % std::size(values)];
  });
  for (const bool drop : {false, true}) {
    const Mesh mesh = extract(
        field,
        {.isovalue = isovalue, .normals = true, .drop_degenerate = drop, .topology = kTrilinear});
    if (!drop) {
      EXPECT_TRUE(is_closed_manifold(mesh));
    }
    EXPECT_TRUE(sides_balance(mesh));
    for (std::size_t i = 0; i < mesh.positions.size(); ++i)
      for (int axis = 0; axis < 3; ++axis) {
        ASSERT_TRUE(mesh.positions[i][axis] >= 0 && mesh.positions[i][axis] <= 19);
        ASSERT_TRUE(std::abs(mesh.normals[i][axis]) <= 1.0001f);
      }
  }
}

TEST(TopologyMesh, HugeTinyAndInfiniteSamplesHaveADefinedSurface) {
  for (const double isovalue : {0.0, 1e-320, 1e-40, 1.0, 1e38, 1e300}) {
    expect_sound_extremes<float>(isovalue);
    expect_sound_extremes<double>(isovalue);
  }
}

TEST(TopologyMesh, CellsWithNaNAreLeftOut) {
  auto field = padded_noise<float>({40, 40, 36}, 0, 100, 0.0f, 14);
  for (std::size_t i = 0; i < field.samples.size(); i += 97)
    field.samples[i] = std::numeric_limits<float>::quiet_NaN();
  const Mesh mesh = extract(field, {.isovalue = 50.5, .normals = true, .topology = kTrilinear});
  EXPECT_GT(mesh.triangles.size(), 10000u);
  EXPECT_EQ(unused_vertices(mesh), 0u);
  for (std::size_t i = 0; i < mesh.positions.size(); ++i)
    for (int axis = 0; axis < 3; ++axis) ASSERT_FALSE(std::isnan(mesh.positions[i][axis]));
}

// Two cells that share a face see its corners in another order; the face is resolved once.
TEST(TopologyMesh, AFaceIsResolvedInOneWayFromBothSides) {
  std::mt19937 random(15);
  for (int i = 0; i < 200'000; ++i) {
    double v[4];
    for (int k = 0; k < 4; ++k) {
      const double size =
          i % 2 ? static_cast<double>(random()) : static_cast<double>(1 + random() % 4);
      v[k] = std::ldexp(size, static_cast<int>(random() % 40) * (i % 5 == 0 ? 50 : 0) - 1000);
      if (k % 2) v[k] = -v[k];
    }
    const bool joined = cell_topology::joins_inside(v[0], v[1], v[2], v[3]);
    for (int turn = 0; turn < 4; ++turn) {
      const int a = turn, b = (turn + 1) % 4, c = (turn + 2) % 4, d = (turn + 3) % 4;
      ASSERT_EQ(cell_topology::joins_inside(v[a], v[b], v[c], v[d]), joined);
      ASSERT_EQ(cell_topology::joins_inside(v[d], v[c], v[b], v[a]), joined);
    }
  }
  // A saddle point at the isovalue joins the inside, whatever the rounding of the products.
  const double third = 1.0 / 3;
  EXPECT_TRUE(cell_topology::joins_inside(third, -third, third, -third));
  EXPECT_TRUE(cell_topology::joins_inside(-third, third, -third, third));
  EXPECT_FALSE(cell_topology::joins_inside(third, -third, third, -std::nextafter(third, 1)));
  EXPECT_TRUE(cell_topology::joins_inside(-third, third, -third, std::nextafter(third, 1)));
  EXPECT_FALSE(cell_topology::joins_inside(0, -1, 5, -1));
}

}  // namespace
}  // namespace isobrick::testing
