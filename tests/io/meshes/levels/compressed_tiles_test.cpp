#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>

#include <isobrick/mesh_file_sink.h>
#include "tests/io/meshes/levels/lattice_fixture.h"
#include "tests/io/meshes/turned_triangles.h"
#include "tests/temporary_folder.h"

// 3D Tiles whose contents are compressed (EXT_meshopt_compression).

namespace isobrick::test {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

std::string bytes_of(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

json scene_of(const std::string& glb) {
  std::uint32_t size = 0;
  std::memcpy(&size, glb.data() + 12, sizeof size);
  return json::parse(glb.substr(20, size));
}

class CompressedTiles : public testing::Test {
 protected:
  /// Writes the mesh plain and compressed.
  void save(const Mesh& mesh, int levels) const {
    mesh.save(plain(), {.levels = levels});
    mesh.save(packed(), {.compress = true, .levels = levels});
  }
  fs::path plain() const { return folder_ / "plain.3dtiles"; }
  fs::path packed() const { return folder_ / "packed.3dtiles"; }

  TemporaryFolder folder_;
};

TEST_F(CompressedTiles, HoldTheSameNumbersInTheSameTiles) {
  Mesh mesh = make_torus(300, {3, -2, 100});
  mesh.unit = "millimeter";
  for (const bool has_normals : {false, true}) {
    if (has_normals) {
      mesh.normals.resize(mesh.positions.size());
      std::copy(mesh.positions.begin(), mesh.positions.end(), mesh.normals.begin());
    }
    save(mesh, 2);
    int contents = 0;
    for (const auto& entry : fs::recursive_directory_iterator(plain())) {
      if (!entry.is_regular_file()) continue;
      const fs::path other = packed() / fs::relative(entry.path(), plain());
      SCOPED_TRACE(other);
      const std::string before = bytes_of(entry.path()), after = bytes_of(other);
      if (other.extension() == ".json") {
        EXPECT_EQ(before, after) << "boxes and errors are those of the same triangles";
        continue;
      }
      ++contents;
      EXPECT_LT(after.size(), before.size());
      json scene = scene_of(after);
      EXPECT_EQ(scene["extensionsRequired"], json({"EXT_meshopt_compression"}));
      EXPECT_EQ(scene["nodes"], scene_of(before)["nodes"]);
      EXPECT_EQ(scene["accessors"][0]["max"], scene_of(before)["accessors"][0]["max"]);
      EXPECT_EQ(scene["bufferViews"].size(), has_normals ? 3U : 2U);
      EXPECT_EQ(after.size() % 4, 0U);
      for (const json& view : scene["bufferViews"]) {
        const json& packed = view["extensions"]["EXT_meshopt_compression"];
        EXPECT_EQ(packed["byteOffset"].get<std::size_t>() % 4, 0U);
      }
      EXPECT_EQ(turned(other), turned(entry.path()));
    }
    EXPECT_GT(contents, 8);
    fs::remove_all(plain());
    fs::remove_all(packed());
  }
}

TEST_F(CompressedTiles, ThreadsNeverShow) {
  const Mesh mesh = make_torus(200);
  mesh.save(plain(), {.compress = true, .threads = 1});
  mesh.save(packed(), {.compress = true, .threads = 3});
  for (const auto& entry : fs::recursive_directory_iterator(plain()))
    if (entry.is_regular_file()) {
      EXPECT_TRUE(bytes_of(entry.path()) ==
                  bytes_of(packed() / fs::relative(entry.path(), plain())));
    }
}

TEST_F(CompressedTiles, AnEmptyMeshIsAnEmptyTileset) {
  save(Mesh(), 0);
  EXPECT_EQ(bytes_of(packed() / "tileset.json"), bytes_of(plain() / "tileset.json"));
}

}  // namespace
}  // namespace isobrick::test
