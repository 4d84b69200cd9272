#include <gtest/gtest.h>
#include <tbb/task_arena.h>

#include <isobrick/error.h>
#include "core/morton.h"
#include "surface/case_tables.h"
#include "surface/cell_math.h"
#include "tests/surface/field.h"

namespace isobrick::testing {
namespace {

template <class T>
class EveryType : public ::testing::Test {};
using Types = ::testing::Types<std::uint8_t, std::int8_t, std::uint16_t, std::int16_t,
                               std::uint32_t, std::int32_t, float, double>;
TYPED_TEST_SUITE(EveryType, Types);

TYPED_TEST(EveryType, EqualsPlainMarchingCubesOnNoise) {
  using T = TypeParam;
  for (const Int3 extent : {Int3{2, 2, 2}, Int3{3, 2, 2}, Int3{33, 34, 35}, Int3{32, 31, 33},
                            Int3{65, 37, 41}, Int3{1, 20, 20}, Int3{70, 2, 66}}) {
    const double lo = std::is_signed_v<T> ? -100 : 10;
    const auto field = padded_noise<T>(extent, lo, 110, static_cast<T>(lo), 7);
    const double iso = 49.5;  // no sample equals it, so that vertices identify their edges
    const Mesh mesh = extract(field, {.isovalue = iso});
    EXPECT_EQ(edge_triangles(mesh), reference_triangles(field, iso))
        << extent.x << " " << extent.y << " " << extent.z;
    std::set<EdgeKey> edges;
    for (const Vec3f& p : mesh.positions) edges.insert(edge_of(p));
    EXPECT_EQ(edges.size(), mesh.positions.size()) << "two vertices on one lattice edge";
  }
}

TYPED_TEST(EveryType, NoisePaddedByOutsideIsClosedAndOriented) {
  using T = TypeParam;
  const double lo = std::is_signed_v<T> ? -100 : 0;
  const auto field = padded_noise<T>({67, 45, 38}, lo, 100, static_cast<T>(lo), 3);
  for (const double iso : {lo + 20, 50.0, 99.0}) {
    const Mesh mesh = extract(field, {.isovalue = iso, .brick = {16, 16, 16}});
    ASSERT_GT(mesh.triangles.size(), 100u);
    EXPECT_GT(closed_sides(mesh), 0) << "isovalue " << iso;
  }
}

TYPED_TEST(EveryType, BrickSizeBatchesAndThreadsNeverShow) {
  using T = TypeParam;
  const double lo = std::is_signed_v<T> ? -50 : 0;
  auto field = padded_noise<T>({150, 97, 70}, lo, 100, static_cast<T>(lo), 11);
  // A calm half, so that some blocks are not active.
  for_each_point({{0, 0, 0}, {80, 97, 70}},
                 [&](Int3 p) { field.at(p) = static_cast<T>(p.z < 30 ? 0 : 90); });
  for (const bool normals : {false, true}) {
    const Mesh expected = extract(field, {.isovalue = 42, .normals = normals});
    ASSERT_GT(expected.triangles.size(), 10000u);
    for (const Int3 brick : {Int3{16, 16, 16}, Int3{32, 32, 32}, Int3{128, 128, 128},
                             Int3{17, 40, 23}, Int3{256, 1, 100}})
      EXPECT_EQ(extract(field, {.isovalue = 42, .brick = brick, .normals = normals}), expected);
    for (const int threads : {1, 2, 8})
      tbb::task_arena(threads).execute(
          [&] { EXPECT_EQ(extract(field, {.isovalue = 42, .normals = normals}), expected); });
    for (const std::size_t batch : {1u, 3u, 40u})
      EXPECT_EQ(
          extract(field,
                  {.isovalue = 42, .normals = normals, .batch = batch, .workspaces = batch + 1}),
          expected);
  }
}

/// The vertex on an edge as cell_math.h defines it, in the order of one vertex at a time.
template <class T>
std::array<Vec3f, 2> defined_vertex(const Field<T>& field, EdgeKey edge, double isovalue) {
  using R = Real<T>;
  const Int3 at{edge[0], edge[1], edge[2]};
  const auto axis = static_cast<int>(edge[3]);
  Int3 next = at;
  next[axis] += 1;
  const R a = static_cast<R>(field.at(at)), b = static_cast<R>(field.at(next));
  const auto t = static_cast<float>(edge_parameter(a, b, static_cast<R>(isovalue)));
  const auto gradient = [&](Int3 p) {
    Vec3f g;
    for (int i = 0; i < 3; ++i) {
      Int3 before = p, after = p;
      before[i] -= p[i] > 0;
      after[i] += p[i] + 1 < field.extent[i];
      const R d = static_cast<R>(field.at(after)) - static_cast<R>(field.at(before));
      g[i] = static_cast<float>(d * (after[i] - before[i] == 2 ? R(0.5) : R(1)));
    }
    return g;
  };
  const Vec3f ga = gradient(at), gb = gradient(next);
  Vec3f where{static_cast<float>(at.x), static_cast<float>(at.y), static_cast<float>(at.z)};
  where[axis] += t;
  Vec3f along{0, 0, 0};
  along[axis] = b > a ? 1.0f : -1.0f;
  const WorldMap world;
  return {
      world.position(where),
      world.unit_normal(
          {ga.x + t * (gb.x - ga.x), ga.y + t * (gb.y - ga.y), ga.z + t * (gb.z - ga.z)}, along)};
}

TYPED_TEST(EveryType, VerticesAreThoseOfTheDefinitionToTheBit) {
  using T = TypeParam;
  // Numbers that need all digits of 32-bit integers and of doubles.
  const double most = sizeof(T) >= 4 ? 4.1e9 : 120;
  const double scale = std::is_same_v<T, std::int32_t> ? 0.5 : 1;
  const auto field = padded_noise<T>({49, 37, 35}, 0, scale * most, T{0}, 21);
  const double isovalue = std::floor(scale * most * 0.4) + 0.5;
  const Mesh mesh = extract(field, {.isovalue = isovalue, .normals = true});
  int looked_at = 0;
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    const EdgeKey edge = edge_of(mesh.positions[i]);
    if (edge[3] < 0) continue;  // so near to a sample that its coordinate is rounded to it
    const auto [position, normal] = defined_vertex(field, edge, isovalue);
    ASSERT_EQ(mesh.positions[i], position) << i;
    ASSERT_EQ(mesh.normals[i], normal) << i;
    ++looked_at;
  }
  EXPECT_GT(looked_at, 10000);
}

TYPED_TEST(EveryType, ChunkLocalMeshHasTheSameTriangles) {
  using T = TypeParam;
  const auto field = padded_noise<T>({70, 40, 37}, 0, 100, T{0}, 5);
  const Mesh local = extract(field, {.isovalue = 42, .indexing = Indexing::chunk_local});
  EXPECT_EQ(soup(local), soup(extract(field, {.isovalue = 42})));
}

TEST(Extractor, IsovaluesAtAndBeyondTheRange) {
  const auto field = padded_noise<std::uint8_t>({20, 21, 22}, 10, 201, 10, 1);
  EXPECT_TRUE(extract(field, {.isovalue = 10}).triangles.empty());  // all inside
  EXPECT_TRUE(extract(field, {.isovalue = -1e30}).triangles.empty());
  EXPECT_TRUE(extract(field, {.isovalue = 201}).triangles.empty());  // none inside
  EXPECT_TRUE(extract(field, {.isovalue = 256}).triangles.empty());
  EXPECT_TRUE(extract(field, {.isovalue = INFINITY}).triangles.empty());
  EXPECT_GT(closed_sides(extract(field, {.isovalue = 200})), 0);
  EXPECT_GT(closed_sides(extract(field, {.isovalue = 10.0001})), 0);
  EXPECT_THROW(extract(field, {.isovalue = NAN}), UsageError);
}

// One block with a surface, all others of its tile not active and inside or
// outside, wherever the tile ends.
TEST(Extractor, BlocksThatAreNotActiveAreFilledWithTheirSide) {
  for (const Int3 extent : {Int3{33, 33, 33}, Int3{17, 33, 20}, Int3{32, 18, 17}, Int3{49, 50, 66}})
    for (int block = 0; block < 8; ++block)
      for (const bool rest_inside : {false, true}) {
        const Int3 corner = Int3{block & 1, block >> 1 & 1, block >> 2} * kBlockEdge;
        std::mt19937 random(static_cast<unsigned>(block));
        const Field<std::int16_t> field(extent, [&](Int3 p) -> double {
          const Box3 core{corner + Int3{2, 2, 2}, corner + Int3{15, 15, 15}};
          return core.contains(p) ? static_cast<double>(random() % 100) : rest_inside ? 99 : 0;
        });
        EXPECT_EQ(edge_triangles(extract(field, {.isovalue = 49.5})),
                  reference_triangles(field, 49.5));
      }
}

TEST(Extractor, ConstantVolumesAreEmpty) {
  Field<float> field({40, 40, 40});
  for (const double iso : {-1.0, 0.0, 1.0})
    EXPECT_TRUE(extract(field, {.isovalue = iso}).triangles.empty());
}

// Few values, so that samples equal the isovalue everywhere.
TEST(Extractor, SamplesThatEqualTheIsovalueKeepItClosed) {
  const auto field = padded_noise<std::uint8_t>({50, 40, 36}, 0, 4, 0, 9);
  for (const double iso : {1.0, 2.0, 3.0}) {
    const Mesh mesh = extract(field, {.isovalue = iso});
    ASSERT_FALSE(mesh.triangles.empty());
    EXPECT_GT(closed_sides(mesh), 0);
    std::set<std::array<std::uint32_t, 3>> faces;
    for (Triangle t : mesh.triangles) {
      std::sort(t.begin(), t.end());
      EXPECT_TRUE(faces.insert(t).second) << "a face twice";
    }
  }
}

// All 2¹² ways to put {outside, at, inside} bits on 3×2×2 samples, one cell
// beside the other; the border stays open, but the shared face must not tear.
TEST(Extractor, AllPairsOfCellsAgreeWithPlainMarchingCubes) {
  for (int bits = 0; bits < 4096; ++bits) {
    Field<float> field({3, 2, 2});
    for (std::size_t i = 0; i < 12; ++i) field.samples[i] = (bits >> i & 1) ? 1.0f : -1.0f;
    ASSERT_EQ(edge_triangles(extract(field, {.isovalue = 0})), reference_triangles(field, 0))
        << bits;
  }
}

TEST(Extractor, CellsWithNaNAreLeftOutAndNoVertexIsIdle) {
  auto field = padded_noise<float>({70, 50, 40}, 0, 100, 0.0f, 21);
  std::mt19937 random(2);
  for (float& v : field.samples)
    if (random() % 20 == 0) v = NAN;
  for_each_point({{30, 0, 0}, {34, 50, 40}}, [&](Int3 p) { field.at(p) = NAN; });
  const double iso = 42.42;
  const Mesh mesh = extract(field, {.isovalue = iso});
  EXPECT_EQ(edge_triangles(mesh), reference_triangles(field, iso));
  std::vector<bool> used(mesh.positions.size());
  for (const Triangle& t : mesh.triangles)
    for (const auto v : t) used[v] = true;
  EXPECT_EQ(std::count(used.begin(), used.end(), false), 0);
  for (const Int3 brick : {Int3{16, 16, 16}, Int3{128, 128, 128}})
    EXPECT_EQ(extract(field, {.isovalue = iso, .brick = brick}), mesh);
  EXPECT_EQ(extract(field, {.isovalue = iso, .normals = true}).triangles, mesh.triangles);
}

TEST(Extractor, InfiniteAndHugeSamplesGiveFinitePositionsOnTheirEdges) {
  auto field = padded_noise<float>({40, 30, 20}, -1, 1, -1.0f, 4);
  std::mt19937 random(5);
  for_each_point({{1, 1, 1}, {39, 29, 19}}, [&](Int3 p) {
    switch (random() % 8) {
      case 0: field.at(p) = INFINITY; break;
      case 1: field.at(p) = -INFINITY; break;
      case 2: field.at(p) = 3e38f; break;
      case 3: field.at(p) = -3e38f; break;
      default: break;
    }
  });
  const Mesh mesh = extract(field, {.isovalue = 0.25, .normals = true});
  EXPECT_GT(closed_sides(mesh), 0);
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    const Vec3f p = mesh.positions[i], n = mesh.normals[i];
    int off_lattice = 0;
    for (int axis = 0; axis < 3; ++axis) {
      ASSERT_TRUE(p[axis] >= 0 && p[axis] <= static_cast<float>(field.extent[axis] - 1));
      off_lattice += p[axis] != std::floor(p[axis]);
    }
    ASSERT_LE(off_lattice, 1);
    ASSERT_NEAR(n.x * n.x + n.y * n.y + n.z * n.z, 1, 1e-4);
  }
}

TEST(Extractor, ARegionOfInterestIsThatPartOfTheMesh) {
  const auto field = padded_noise<std::uint16_t>({100, 90, 80}, 0, 1000, 0, 6);
  const double iso = 300.5;
  for (const Box3 roi : {Box3{{5, 40, 33}, {70, 89, 66}}, Box3{{32, 32, 32}, {64, 64, 64}},
                         Box3{{31, 33, 0}, {33, 34, 80}}, Box3{{7, 7, 7}, {8, 80, 80}}}) {
    const Mesh mesh = extract(field, {.isovalue = iso, .roi = roi});
    Field<std::uint16_t> part(roi.extent());
    for_each_point(part.box(), [&](Int3 p) { part.at(p) = field.at(p + roi.lo); });
    EdgeTriangles expected;
    for (auto t : reference_triangles(part, iso)) {
      for (EdgeKey& e : t)
        for (int axis = 0; axis < 3; ++axis) e[static_cast<std::size_t>(axis)] += roi.lo[axis];
      expected.push_back(t);
    }
    std::sort(expected.begin(), expected.end());
    EXPECT_EQ(edge_triangles(mesh), expected);
    std::set<EdgeKey> edges;
    for (const Vec3f& p : mesh.positions) edges.insert(edge_of(p));
    EXPECT_EQ(edges.size(), mesh.positions.size());
    std::set<std::uint32_t> used;
    for (const Triangle& t : mesh.triangles) used.insert(t.begin(), t.end());
    EXPECT_EQ(used.size(), mesh.positions.size());
  }
}

// Work spaces that extractors share are those of the budget of the last one.
TEST(Extractor, WorkSpacesFollowTheLimit) {
  const auto field = padded_noise<std::uint8_t>({100, 70, 70}, 0, 100, std::uint8_t{0}, 3);
  const Lattice lattice{field.extent, {64, 64, 64}, ScalarType::u8};
  const DenseBricks bricks(lattice, field.samples.data());
  const SurfaceOptions options{.isovalue = 50, .roi = lattice.box()};
  std::vector<TileWork> tiles;
  for_each_morton(lattice.tiles(), [&](Int3 tile) { tiles.push_back({tile, 0xff}); });
  const auto spaces = std::make_shared<TileWorkSpaces>();
  std::vector<Triangle> first;
  for (const std::size_t limit : {20, 3, 7}) {
    CpuExtractor extractor(lattice, options, {.tiles = limit}, nullptr, spaces);
    EXPECT_LE(spaces->size(), limit);
    extractor.extract(tiles, bricks, nullptr);
    EXPECT_LE(spaces->size(), limit);
    const std::vector<Triangle> made(extractor.mesh().triangles.begin(),
                                     extractor.mesh().triangles.end());
    if (first.empty()) first = made;
    EXPECT_EQ(made, first);
  }
  EXPECT_FALSE(first.empty());
}

}  // namespace
}  // namespace isobrick::testing
