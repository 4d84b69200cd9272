#include <gtest/gtest.h>

#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <span>
#include <string>
#include <vector>

#include <isobrick/error.h>
#include <isobrick/mesh_file_sink.h>
#include <isobrick/progress.h>
#include "tests/io/bytes/temp_dir.h"
#include "tests/io/meshes/test_meshes.h"

// Meshes in memory become files.
namespace isobrick::inline v0 {
namespace {

std::string bytes_of(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

Mesh mesh_of(const TestMesh& ball) {
  Mesh mesh;
  const auto copy = [](const auto& from, auto& to) {
    to.resize(from.size());
    std::copy(from.begin(), from.end(), to.data());
  };
  copy(ball.positions, mesh.positions);
  copy(ball.normals, mesh.normals);
  copy(ball.triangles, mesh.triangles);
  return mesh;
}

/// Ends the operation at a call of advance().
class EndingProgress final : public Progress {
 public:
  explicit EndingProgress(int calls) : left_(calls) {}
  void begin(std::string_view, std::uint64_t total) override { total_ = total; }
  void advance(std::uint64_t done) override {
    if (--left_ < 0) throw Cancelled("ended");
    done_ += done;
  }
  void end() override { EXPECT_EQ(done_, total_); }

 private:
  int left_;
  std::uint64_t done_ = 0, total_ = 0;
};

TEST(MeshSave, WritesAttributes) {
  const TempDir dir;
  const TestMesh ball = make_ball({1, 2, 3}, 1, 800);  // several parts
  const Mesh mesh = mesh_of(ball);
  std::vector<float> values(ball.positions.size());
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = static_cast<float>(i);
  const VertexAttribute number{"number", values};
  for (const std::string extension : {"ply", "vtp", "pvtp", "glb"}) {
    mesh.save(dir / ("a." + extension), {}, no_progress(), {&number, 1});
    const auto sink = create_mesh_file(dir / ("b." + extension), {});
    sink->begin({.has_normals = true, .attributes = {"number"}});
    MeshChunk chunk = mesh.chunk();
    chunk.attributes = {&number, 1};
    sink->write(chunk);
    sink->finish();
    EXPECT_TRUE(bytes_of(dir / ("a." + extension)) == bytes_of(dir / ("b." + extension)) ||
                extension == "pvtp")
        << extension;
  }
  EXPECT_TRUE(bytes_of(dir / "a.pvtp.parts/part_1.vtp") ==
              bytes_of(dir / "b.pvtp.parts/part_1.vtp"));
  for (const std::string extension : {"stl", "obj"})
    EXPECT_THROW(mesh.save(dir / ("a." + extension), {}, no_progress(), {&number, 1}), UsageError);
  const VertexAttribute few{"few", std::span(values).first(7)};
  EXPECT_THROW(mesh.save(dir / "c.ply", {}, no_progress(), {&few, 1}), UsageError);
  EXPECT_FALSE(std::filesystem::exists(dir / "c.ply"));
}

TEST(MeshSave, WritesInPartsWhatOneChunkWrites) {
  const TempDir dir;
  const TestMesh ball = make_ball({1, 2, 3}, 1, 800);  // several parts
  ASSERT_GT(ball.positions.size(), std::size_t{1} << 20);
  const Mesh mesh = mesh_of(ball);
  for (const std::string extension : {"ply", "stl", "glb"}) {
    EndingProgress progress(1000);
    mesh.save(dir / ("parts." + extension), {}, progress);
    const auto sink = create_mesh_file(dir / ("chunk." + extension), {});
    sink->begin({true, {0, 1, 2}, {2, 3, 4}, MeshBounds{{0, 1, 2}, {2, 3, 4}}});
    sink->write(mesh.chunk());
    sink->finish();
    EXPECT_TRUE(bytes_of(dir / ("parts." + extension)) == bytes_of(dir / ("chunk." + extension)))
        << extension;
  }
}

TEST(MeshSave, LeavesNoFileWhereProgressEndsIt) {
  const TempDir dir;
  const Mesh mesh = mesh_of(make_ball({1, 2, 3}, 1, 300));
  for (const std::string extension : {"ply", "stl", "obj", "glb", "vtp"})
    for (const int calls : {0, 1}) {
      EndingProgress progress(calls);
      if (extension == "stl" && calls == 1) continue;  // one part
      EXPECT_THROW(mesh.save(dir / ("a." + extension), {}, progress), Cancelled) << extension;
    }
  EXPECT_TRUE(dir.list().empty());
}

TEST(MeshSave, NamesTheErrorOfTheSystem) {
  const TempDir dir;
  try {
    Mesh().save(dir / "none/a.ply");
    FAIL();
  } catch (const SystemError& error) {
    EXPECT_EQ(error.code(), ENOENT);
    EXPECT_NE(std::string(error.what()).find("none/a.ply"), std::string::npos) << error.what();
  }
}

}  // namespace
}  // namespace isobrick
