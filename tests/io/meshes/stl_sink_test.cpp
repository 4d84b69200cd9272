#include "io/meshes/stl_sink.h"

#include <gtest/gtest.h>

#include <cstring>

#include "test_meshes.h"
#include "tests/io/bytes/temp_dir.h"

namespace isobrick::inline v0 {
namespace {

struct Facet {
  Vec3f normal, corners[3];
};

std::vector<Facet> read_stl(const std::string& file) {
  std::uint32_t count = 0;
  std::memcpy(&count, file.data() + 80, sizeof(count));
  EXPECT_EQ(file.size(), 84 + 50 * std::size_t{count});
  std::vector<Facet> facets(count);
  for (std::size_t i = 0; i < count; ++i) {
    std::memcpy(&facets[i], file.data() + 84 + 50 * i, sizeof(Facet));
    EXPECT_EQ(file.substr(84 + 50 * i + 48, 2), std::string(2, '\0'));
  }
  return facets;
}

TEST(StlSink, ReadBack) {
  const TempDir dir;
  const TestMesh ball = make_ball({1, 2, 3}, 4, 60);
  StlSink sink(dir / "a.stl", false);
  EXPECT_EQ(sink.indexing(), Indexing::chunk_local);
  sink.begin({true, {0, 0, 0}, {9, 9, 9}});
  sink.write(ball.chunk());
  sink.write(ball.chunk(ball.positions.size()));
  sink.finish();
  const std::string file = dir.read("a.stl");
  EXPECT_EQ(sink.bytes(), file.size());
  EXPECT_NE(file.substr(0, 5), "solid");
  const auto facets = read_stl(file);
  ASSERT_EQ(facets.size(), 2 * ball.triangles.size());
  for (std::size_t i = 0; i < facets.size(); ++i) {
    const Triangle t = ball.triangles[i % ball.triangles.size()];
    for (std::size_t k = 0; k < 3; ++k) EXPECT_EQ(facets[i].corners[k], ball.positions[t[k]]);
    const Vec3f n = facets[i].normal, out = ball.normals[t[0]];
    const float along = n.x * out.x + n.y * out.y + n.z * out.z;
    if (n != Vec3f{}) {
      EXPECT_GT(along, 0.99f);
    }
  }
}

TEST(StlSink, DegenerateTrianglesHaveNoNormal) {
  const TempDir dir;
  TestMesh mesh;
  mesh.positions = {{0, 0, 0}, {1, 1, 1}, {2, 2, 2}};
  mesh.triangles = {{0, 1, 2}, {1, 1, 1}};
  StlSink sink(dir / "a.stl", false);
  sink.begin({});
  sink.write(mesh.chunk());
  sink.finish();
  for (const Facet& facet : read_stl(dir.read("a.stl"))) EXPECT_EQ(facet.normal, Vec3f{});
}

TEST(StlSink, TinyTrianglesHaveTheirNormal) {
  const TempDir dir;
  TestMesh mesh;
  mesh.positions = {{0, 0, 0}, {1e-20f, 0, 0}, {0, 1e-20f, 0}};
  mesh.triangles = {{0, 1, 2}};
  StlSink sink(dir / "a.stl", false);
  sink.begin({});
  sink.write(mesh.chunk());
  sink.finish();
  EXPECT_EQ(read_stl(dir.read("a.stl")).at(0).normal, (Vec3f{0, 0, 1}));
}

TEST(StlSink, TooManyTriangles) {
  const TempDir dir;
  StlSink sink(dir / "a.stl", false);
  sink.begin({});
  MeshChunk chunk;
  chunk.triangles = {reinterpret_cast<const Triangle*>(&sink), std::size_t{1} << 32};
  EXPECT_TRUE(contains(message_of<Error>([&] { sink.write(chunk); }), "PLY"));
}

}  // namespace
}  // namespace isobrick
