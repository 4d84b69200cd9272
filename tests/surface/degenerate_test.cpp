#include <gtest/gtest.h>
#include <tbb/task_arena.h>

#include "surface/coincident_vertices.h"
#include "surface/sample_vertices.h"
#include "tests/surface/kept_triangles.h"

// SurfaceOptions::drop_degenerate.

namespace isobrick::testing {
namespace {

template <class T>
class DropDegenerate : public ::testing::Test {};
using Types = ::testing::Types<std::uint8_t, std::int8_t, std::uint16_t, std::int16_t,
                               std::uint32_t, std::int32_t, float, double>;
TYPED_TEST_SUITE(DropDegenerate, Types);

/// Noise of four values, two of them on either side of a third.
template <class T>
Field<T> coarse_noise(Int3 extent, unsigned seed) {
  Field<T> field = padded_noise<T>(extent, 0, 4, T{0}, seed);
  for (T& v : field.samples) v = static_cast<T>(std::floor(static_cast<double>(v)));
  return field;
}

TYPED_TEST(DropDegenerate, IsTheMergedMeshOnNoiseOfFewValues) {
  for (const Int3 extent : {Int3{66, 35, 40}, Int3{33, 33, 33}, Int3{2, 3, 70}})
    for (const double iso : {1.0, 2.0, 3.0}) {
      const auto field = coarse_noise<TypeParam>(extent, 13);
      const Mesh kept = expect_kept_triangles(field, {.isovalue = iso});
      EXPECT_TRUE(sides_balance(kept)) << iso;
      EXPECT_GE(kept.degenerate, extent.x > 2 ? kept.triangles.size() / 20 : 0);
    }
}

TYPED_TEST(DropDegenerate, BricksBatchesAndThreadsNeverShow) {
  const auto field = coarse_noise<TypeParam>({68, 67, 40}, 5);
  for (const bool normals : {false, true}) {
    Request request{.isovalue = 2, .normals = normals, .drop_degenerate = true};
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
  }
}

TYPED_TEST(DropDegenerate, ChangesNothingWithoutTies) {
  const auto field = padded_noise<TypeParam>({70, 50, 40}, 0, 100, TypeParam{0}, 17);
  for (const double iso : {50.0078125 + 0.25, -3.5, 1e300, HUGE_VAL}) {
    Mesh all = extract(field, {.isovalue = iso});
    EXPECT_EQ(extract(field, {.isovalue = iso, .drop_degenerate = true}), all);
  }
}

TYPED_TEST(DropDegenerate, ChunksStandAlone) {
  const auto field = coarse_noise<TypeParam>({70, 40, 37}, 3);
  Request request{.isovalue = 2, .drop_degenerate = true};
  const Mesh welded = extract(field, request);
  request.indexing = Indexing::chunk_local;
  const Mesh local = extract(field, request);
  EXPECT_EQ(soup(local), soup(welded));
  EXPECT_EQ(local.degenerate, welded.degenerate);
  EXPECT_EQ(unused_vertices(local), 0u);
}

// docs/design/surface.md and docs/reference/meshes.md state it.
TEST(DropDegenerateAt, TwoFourSixOrEightTrianglesShareASide) {
  const auto field = coarse_noise<std::uint8_t>({66, 35, 40}, 13);
  const std::set<std::size_t> manifold{2}, touching{2, 4, 6, 8};
  EXPECT_EQ(triangles_at_sides(extract(field, {.isovalue = 2})), manifold);
  EXPECT_EQ(triangles_at_sides(extract(field, {.isovalue = 2, .drop_degenerate = true})), touching);
}

// The budget of an extraction counts on this for any input.
TEST(DropDegenerateAt, BoundariesAreNoLargerThanTheirBound) {
  TileBoundary boundary;
  TileState tile;
  tile.boundary = &boundary;
  tile.shape = {.origin = {32, 32, 32}, .lo = {0, 0, 0}, .hi = {32, 32, 32}, .first = {}};
  tile.on_samples = std::make_unique<SampleVertices>();
  PodBuffer<SampleVertex>& vertices = tile.on_samples->vertices;
  for_each_point({{0, 0, 0}, {kTileSamples, kTileSamples, kTileSamples}}, [&](Int3 p) {
    vertices.resize(vertices.size() + 1);
    vertices[vertices.size() - 1] = {static_cast<std::uint32_t>(p.x | p.y << 6 | p.z << 12), 0,
                                     SampleVertex::kOwn, true};
  });
  publish_sample_vertices({.border = {{0, 0, 0}, {128, 128, 128}}}, tile);
  EXPECT_EQ(boundary.on_samples.size(), 33u * 33 * 33 - 31 * 31 * 31);
  EXPECT_LE(boundary.on_samples.capacity() * sizeof(SharedSample),
            CpuExtractor::boundary_bytes({1, 1, 1}, true) -
                CpuExtractor::boundary_bytes({1, 1, 1}, false));
}

// Where eight tiles meet, whoever of them has the first triangle.
TEST(DropDegenerateAt, TheCornerOfEightTiles) {
  for (unsigned seed = 0; seed < 300; ++seed) {
    std::mt19937 random(seed);
    const Index size = 1 + seed % 4;
    const unsigned rare = 1 + seed / 4 % 5;
    const Box3 core{Int3{32, 32, 32} - Int3{size, size, size},
                    Int3{32, 32, 32} + Int3{size, size, size}};
    const Field<std::int16_t> field({50, 45, 66}, [&](Int3 p) -> double {
      if (!core.contains(p)) return 0;
      return random() % rare ? 0 : static_cast<double>(random() % 4);
    });
    for (const double iso : {1.0, 2.0})
      ASSERT_TRUE(sides_balance(expect_kept_triangles(field, {.isovalue = iso}))) << seed;
  }
}

// All ways in which the corners of a cell are outside, at or above the isovalue.
TEST(DropDegenerateAt, EveryCellOfThreeValues) {
  for (int code = 0; code < 6561; ++code) {
    Field<float> field({4, 4, 4});
    std::fill(field.samples.begin(), field.samples.end(), -1.0f);
    for (int c = 0, rest = code; c < 8; ++c, rest /= 3)
      field.at(Int3{1 + (c & 1), 1 + (c >> 1 & 1), 1 + (c >> 2)}) =
          static_cast<float>(rest % 3 - 1);
    ASSERT_TRUE(sides_balance(expect_kept_triangles(field, {.isovalue = 0}))) << code;
  }
}

TEST(DropDegenerateAt, ALoneSampleIsNoSurface) {
  Field<std::uint8_t> field({40, 40, 40});
  field.at({32, 32, 32}) = 7;
  const Mesh mesh = expect_kept_triangles(field, {.isovalue = 7});
  EXPECT_TRUE(mesh.positions.empty());
  EXPECT_EQ(mesh.degenerate, 8u);
}

TEST(DropDegenerateAt, SpheresOfIntegerDistance) {
  const Int3 centre{33, 32, 31};
  const Field<std::int32_t> field({67, 66, 64}, [&](Int3 p) -> double {
    const Int3 d = p - centre;
    return -static_cast<double>(d.x * d.x + d.y * d.y + d.z * d.z);
  });
  for (const int radius : {5, 13, 25, 29}) {
    const Mesh kept = expect_kept_triangles(
        field, {.isovalue = -static_cast<double>(radius * radius), .normals = true});
    EXPECT_GT(kept.degenerate, 0u);
    // A sphere still: no edge has more than two triangles, and Euler's number is 2.
    const std::ptrdiff_t sides = closed_sides(kept);
    EXPECT_EQ(static_cast<std::ptrdiff_t>(kept.positions.size()) - sides +
                  static_cast<std::ptrdiff_t>(kept.triangles.size()),
              2);
  }
}

TEST(DropDegenerateAt, NaNAndRegions) {
  auto field = coarse_noise<float>({70, 50, 66}, 21);
  const Box3 rois[] = {{{0, 0, 0}, {70, 50, 66}},
                       {{5, 20, 31}, {69, 49, 65}},
                       {{32, 32, 32}, {64, 50, 64}},
                       {{31, 31, 0}, {34, 34, 66}}};
  for (const bool nan : {false, true}) {
    if (nan) {
      std::mt19937 random(2);
      for (float& v : field.samples)
        if (random() % 20 == 0) v = NAN;
      for_each_point({{31, 31, 31}, {33, 33, 33}}, [&](Int3 p) { field.at(p) = NAN; });
    }
    for (const Box3& roi : rois) {
      Request request{.isovalue = 2, .roi = roi, .drop_degenerate = true};
      const Mesh kept = expect_kept_triangles(field, request);
      EXPECT_GT(kept.degenerate, 50u);
      request.brick = {16, 16, 16};
      request.batch = 2;
      EXPECT_EQ(extract(field, request), kept);
    }
  }
}

// 0.7 is no float. The float next to it is below, and so a sample that equals it
// is outside, but vertices around it lie exactly on it all the same.
TEST(DropDegenerateAt, AnIsovalueBetweenTwoFloats) {
  auto field = coarse_noise<float>({40, 37, 35}, 8);
  for (float& v : field.samples) v = v == 1 ? 0.7f : v;
  const Mesh kept = expect_kept_triangles(field, {.isovalue = 0.7});
  EXPECT_GT(kept.degenerate, kept.triangles.size() / 8);
  EXPECT_TRUE(sides_balance(kept));
}

TEST(DropDegenerateAt, InfiniteNeighboursAndAnInfiniteIsovalue) {
  auto field = coarse_noise<float>({40, 37, 35}, 9);
  for (float& v : field.samples) v = v == 3 ? HUGE_VALF : v;
  EXPECT_TRUE(sides_balance(extract(field, {.isovalue = 2, .drop_degenerate = true})));
  const Mesh all = extract(field, {.isovalue = HUGE_VAL});
  EXPECT_EQ(extract(field, {.isovalue = HUGE_VAL, .drop_degenerate = true}), all);
}

// The edges around a coincident vertex had normals of their own that differed by rounding, or
// by direction where the gradient vanishes; the one vertex has the sample's.
TEST(DropDegenerateAt, NormalsAreThoseOfTheSamples) {
  const auto field = coarse_noise<std::uint8_t>({66, 35, 40}, 8);
  const Mesh kept = extract(field, {.isovalue = 2, .normals = true, .drop_degenerate = true});
  std::size_t on_samples = 0, without_gradient = 0;
  for (std::size_t i = 0; i < kept.positions.size(); ++i) {
    const EdgeKey key = edge_of(kept.positions[i]);
    const Vec3f n = kept.normals[i];
    ASSERT_NEAR(n.x * n.x + n.y * n.y + n.z * n.z, 1, 1e-5);
    if (key[3] >= 0) continue;
    ++on_samples;
    Vec3d g;
    for (int axis = 0; axis < 3; ++axis) {
      Int3 lo{key[0], key[1], key[2]}, hi = lo;
      --lo[axis];
      ++hi[axis];
      g[axis] = static_cast<double>(field.at(hi)) - static_cast<double>(field.at(lo));
    }
    const double length = std::sqrt(g.x * g.x + g.y * g.y + g.z * g.z);
    without_gradient += length == 0;
    if (length == 0) continue;
    for (int axis = 0; axis < 3; ++axis) ASSERT_NEAR(n[axis], -g[axis] / length, 1e-5);
  }
  EXPECT_GT(on_samples, 1000u);
  EXPECT_GT(without_gradient, 10u);
}

TEST(DropDegenerateAt, MirroredAxesKeepTheOrientation) {
  const auto field = coarse_noise<std::uint8_t>({40, 35, 40}, 4);
  Request request{.isovalue = 2, .drop_degenerate = true};
  const Mesh plain = extract(field, request);
  request.transform.direction = {-1, 0, 0, 0, 1, 0, 0, 0, 1};
  const Mesh turned = extract(field, request);
  ASSERT_EQ(turned.triangles.size(), plain.triangles.size());
  for (std::size_t i = 0; i < plain.triangles.size(); ++i) {
    const Triangle &a = plain.triangles[i], &b = turned.triangles[i];
    ASSERT_EQ((Triangle{a[0], a[2], a[1]}), b);
  }
}

}  // namespace
}  // namespace isobrick::testing
