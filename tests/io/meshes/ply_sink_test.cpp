#include "io/meshes/ply_sink.h"

#include <gtest/gtest.h>

#include <cstring>
#include <sstream>

#include "test_meshes.h"
#include "tests/io/bytes/temp_dir.h"

namespace isobrick::inline v0 {
namespace {

std::string header_of(const std::string& file) {
  const std::string end = "end_header\n";
  return file.substr(0, file.find(end) + end.size());
}

template <class T>
std::string raw(const T& value) {
  return {reinterpret_cast<const char*>(&value), sizeof(T)};
}

std::string expected_body(const TestMesh& mesh, bool normals, int copies) {
  std::string body;
  for (int c = 0; c < copies; ++c)
    for (std::size_t i = 0; i < mesh.positions.size(); ++i)
      body += raw(mesh.positions[i]) + (normals ? raw(mesh.normals[i]) : "");
  for (int c = 0; c < copies; ++c)
    for (const Triangle& t : mesh.triangles) body += '\3' + raw(t);
  return body;
}

TEST(PlySink, ByteByByte) {
  const TempDir dir;
  const TestMesh ball = make_ball({1, 2, 3}, 4, 90);  // some buffers long
  for (const bool normals : {false, true}) {
    const std::string name = normals ? "n.ply" : "p.ply";
    PlySink sink(dir / name, false);
    EXPECT_EQ(sink.indexing(), Indexing::welded);
    sink.begin({normals, {0, 0, 0}, {9, 9, 9}});
    constexpr int copies = 8;
    for (int i = 0; i < copies; ++i)
      sink.write(ball.chunk(static_cast<std::uint64_t>(i) * ball.positions.size(), normals));
    sink.finish();
    const std::string file = dir.read(name), header = header_of(file);
    EXPECT_EQ(sink.bytes(), file.size()) << "scratch files are forgotten";
    EXPECT_TRUE(file.substr(header.size()) == expected_body(ball, normals, copies));
    EXPECT_TRUE(contains(
        header, "\nelement vertex " + std::to_string(copies * ball.positions.size()) + "\n"));
    EXPECT_TRUE(contains(
        header, "\nelement face " + std::to_string(copies * ball.triangles.size()) + "\n"));
    EXPECT_EQ(contains(header, "property float nx"), normals);
  }
  EXPECT_EQ(dir.list(), (std::vector<std::string>{"n.ply", "p.ply"}));
}

TEST(PlySink, Header) {
  const TempDir dir;
  PlySink sink(dir / "a.ply", false);
  sink.begin({false, {0, 0, 0}, {1, 1, 1}});
  sink.finish();
  std::string header = dir.read("a.ply");
  std::erase(header, '.');
  EXPECT_EQ(header,
            "ply\nformat binary_little_endian 10\ncomment Isobrick \nelement vertex 0\n"
            "property float x\nproperty float y\nproperty float z\nelement face 0\n"
            "property list uchar uint vertex_indices\nend_header\n");
}

TEST(PlySink, LeavesNothingWhenGivenUp) {
  const TempDir dir;
  {
    const TestMesh ball = make_ball({0, 0, 0}, 1, 300);
    PlySink sink(dir / "a.ply", false);
    sink.begin({true, {0, 0, 0}, {1, 1, 1}});
    sink.write(ball.chunk());
  }
  EXPECT_TRUE(dir.list().empty());
}

TEST(PlySink, TooManyVertices) {
  const TempDir dir;
  PlySink sink(dir / "a.ply", false);
  sink.begin({false, {0, 0, 0}, {1, 1, 1}});
  MeshChunk chunk;
  // Only counted, never touched.
  chunk.positions = {reinterpret_cast<const Vec3f*>(&sink), std::size_t{1} << 32};
  const auto message = message_of<Error>([&] { sink.write(chunk); });
  EXPECT_TRUE(contains(message, "STL") && contains(message, "--roi")) << message;
}

}  // namespace
}  // namespace isobrick
