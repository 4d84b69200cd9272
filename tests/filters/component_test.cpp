#include <isobrick/mesh_filters.h>

#include <gtest/gtest.h>

#include <isobrick/error.h>
#include "filters/component_stage.h"
#include "tests/filters/filter_fixture.h"

namespace isobrick::test {
namespace {

using Sizes = std::map<std::uint32_t, std::uint64_t>;

bool is_at_least(const Sizes& sizes, std::uint32_t root, std::uint64_t triangles) {
  return sizes.at(root) >= triangles;
}

/// Whether fewer than `count` components are larger, or as large and first.
bool is_largest(const Sizes& sizes, std::uint32_t root, std::size_t count) {
  std::size_t before = 0;
  for (const auto& [other, size] : sizes)
    before += size > sizes.at(root) || (size == sizes.at(root) && other < root);
  return before < count;
}

TEST(Components, BelowTheMinimumAreDropped) {
  const Mesh mesh = debris(true);
  for (const std::uint64_t min : {2u, 60u, 150u, 1u << 20}) {
    const Mesh expected = kept_components(mesh, [&](const Sizes& sizes, std::uint32_t root) {
      return is_at_least(sizes, root, min);
    });
    const Filtered result = filtered(mesh, {.min_component = min});
    EXPECT_TRUE(same(result.mesh, expected)) << min;
    EXPECT_EQ(result.size.triangles, expected.triangles.size());
    EXPECT_EQ(result.size.vertices, expected.positions.size());
    EXPECT_LT(expected.triangles.size(), mesh.triangles.size() + (min == 2 ? 1 : 0));
  }
}

// The lattice of balls has many of one size, so the first vertex decides.
TEST(Components, WithMostTrianglesAreKept) {
  const Mesh mesh = debris();
  for (const std::size_t count : {1u, 2u, 3u, 17u, 100u, 100000u}) {
    const Mesh expected = kept_components(mesh, [&](const Sizes& sizes, std::uint32_t root) {
      return is_largest(sizes, root, count);
    });
    EXPECT_TRUE(same(filtered(mesh, {.largest = count}).mesh, expected)) << count;
  }
}

TEST(Components, OfOneSizeAreKeptByTheirFirstVertex) {
  Mesh mesh;
  const Mesh piece = sphere(8);
  for (int i = 0; i < 5; ++i) add(mesh, piece, {float(3 * i), 0, 0});
  Mesh expected;
  add(expected, piece);
  add(expected, piece, {3, 0, 0});
  EXPECT_TRUE(same(filtered(mesh, {.largest = 2}).mesh, expected));
}

TEST(Components, OfMoreTrianglesThanADigitAreCompared) {
  Mesh mesh;
  add(mesh, sphere(12));
  add(mesh, sphere(130), {5, 0, 0});  // more than 65536
  add(mesh, sphere(110), {10, 0, 0});
  ASSERT_GT(sphere(110).triangles.size(), 65536u);
  Mesh expected;
  add(expected, sphere(130), {5, 0, 0});
  EXPECT_TRUE(same(filtered(mesh, {.largest = 1}).mesh, expected));
  add(expected, sphere(110), {10, 0, 0});
  EXPECT_TRUE(same(filtered(mesh, {.largest = 2}).mesh, expected));
}

TEST(Components, DependOnNeitherChunksNorMemory) {
  const Mesh mesh = debris(true);
  for (const MeshFilterOptions& request :
       {MeshFilterOptions{.min_component = 80}, MeshFilterOptions{.largest = 20}}) {
    const Mesh expected = filtered(mesh, request).mesh;
    ASSERT_FALSE(expected.triangles.empty());
    for (const std::uint64_t memory : {0u, 1u << 20})
      for (const std::size_t chunk : {5u, 777u}) {
        MeshFilterOptions options = request;
        options.memory = memory;
        EXPECT_TRUE(same(filtered(mesh, options, chunk).mesh, expected));
      }
  }
}

// Pages of 256 bytes, a few of them: every access may fetch one.
TEST(Components, NeedFewPages) {
  const Mesh mesh = debris(true);
  const Mesh expected = filtered(mesh, {.largest = 20}).mesh;
  Mesh result;
  MemorySink sink(result);
  ComponentStage<std::uint32_t> stage(sink, {}, {.page_bytes = 256}, 8 << 10, {.largest = 20});
  EXPECT_LE(stage.memory(), 8u << 10);
  write_chunks(mesh, stage, 100);
  EXPECT_TRUE(same(result, expected));
}

TEST(Components, OfAMeshWithoutTriangles) {
  const Filtered result = filtered(Mesh(), {.largest = 3, .measure = true});
  EXPECT_TRUE(result.mesh.positions.empty());
  EXPECT_EQ(result.measure->components, 0u);
}

TEST(Components, ThatTouchInAVertexAreOne) {
  Mesh mesh;
  mesh.positions.resize(5);
  mesh.triangles.resize(2);
  mesh.triangles[0] = {3, 4, 0};
  mesh.triangles[1] = {0, 1, 2};
  EXPECT_EQ(measure(mesh).components, 1u);
  mesh.triangles[1] = {1, 1, 2};
  EXPECT_EQ(measure(mesh).components, 2u);
}

TEST(MeshFilter, RefusesWhatMakesNoSense) {
  Mesh mesh;
  MemorySink sink(mesh);
  EXPECT_THROW(MeshFilter(sink, {.min_component = 5, .largest = 2}), UsageError);
  EXPECT_THROW(MeshFilter(sink, {.smooth = -1}), UsageError);
  EXPECT_THROW(MeshFilter(sink, {.smooth = 5, .pass_band = 0}), UsageError);
  EXPECT_THROW(MeshFilter(sink, {.smooth = 5, .pass_band = 0.9}), UsageError);
  EXPECT_THROW(MeshFilter(sink, {.smooth = 5, .pass_band = std::nan("")}), UsageError);
}

TEST(MeshFilter, WithNothingToDoPassesChunksOn) {
  FunctionSink sink([](const MeshChunk&) {}, Indexing::chunk_local);
  EXPECT_EQ(MeshFilter(sink, {}).indexing(), Indexing::chunk_local);
  EXPECT_EQ(MeshFilter(sink, {.measure = true}).indexing(), Indexing::welded);
}

// Corners in the order of the triangles, whatever the kind of indexing.
TEST(MeshFilter, WritesToSinksOfUnweldedChunks) {
  const Mesh mesh = debris(true);
  const Mesh expected = filtered(mesh, {.largest = 40}).mesh;
  for (const std::uint64_t memory : {0u, 1u << 26}) {
    std::vector<Vec3f> corners, normals;
    std::uint64_t vertices = 0;
    FunctionSink sink(
        [&](const MeshChunk& chunk) {
          EXPECT_EQ(chunk.first_vertex, vertices);
          vertices += chunk.positions.size();
          for (const Triangle& t : chunk.triangles)
            for (const std::uint32_t v : t) {
              ASSERT_LT(v, chunk.positions.size());
              corners.push_back(chunk.positions[v]);
              normals.push_back(chunk.normals[v]);
            }
        },
        Indexing::chunk_local);
    MeshFilter filter(sink, {.largest = 40, .measure = true, .memory = memory});
    write_chunks(mesh, filter, 1000);
    ASSERT_EQ(corners.size(), 3 * expected.triangles.size());
    for (std::size_t i = 0; i < corners.size(); ++i) {
      const std::uint32_t v = expected.triangles[i / 3][i % 3];
      ASSERT_EQ(corners[i], expected.positions[v]);
      ASSERT_EQ(normals[i], expected.normals[v]);
    }
    EXPECT_LT(vertices, corners.size() / 3) << "vertices are not shared within chunks";
    EXPECT_EQ(filter.size().vertices, expected.positions.size());
  }
}

TEST(MeshFilter, OfAMeshInMemory) {
  const Mesh mesh = debris(true);
  for (const MeshFilterOptions& options :
       {MeshFilterOptions{.largest = 40}, {.smooth = 3}, {.simplify_ratio = 0.3}, {}})
    EXPECT_TRUE(same(apply_filters(mesh, options), filtered(mesh, options).mesh));
  Mesh wrong = debris();
  wrong.triangles[0][0] = 1u << 30;
  EXPECT_THROW(apply_filters(wrong, {.smooth = 1}), UsageError);
  Mesh few = debris(true);
  few.normals.resize(3);
  EXPECT_THROW(apply_filters(few, {.smooth = 1}), UsageError);
}

TEST(MeshFilter, EndsWhenItIsCancelled) {
  std::stop_source stop;
  Mesh result;
  MemorySink sink(result);
  MeshFilter filter(sink, {.smooth = 1000, .cancel = stop.get_token()});
  const Mesh mesh = sphere(20);
  filter.begin({});
  filter.write(mesh.chunk());
  stop.request_stop();
  EXPECT_THROW(filter.finish(), Cancelled);
  EXPECT_TRUE(result.triangles.empty());
}

TEST(MeshFilter, NamesTheFolderOfItsScratchFiles) {
  const Mesh mesh = sphere(60);
  Mesh result;
  MemorySink sink(result);
  MeshFilter filter(sink, {.largest = 1, .memory = 0, .scratch_beside = "/no such folder/a.ply"});
  filter.begin({});
  try {
    filter.write(mesh.chunk());
    FAIL() << "written to nowhere";
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("/no such folder"), std::string::npos);
  }
}

}  // namespace
}  // namespace isobrick::test
