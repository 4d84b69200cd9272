#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>

#include <isobrick/error.h>
#include <isobrick/mesh_file_sink.h>
#include "tests/io/meshes/levels/lattice_fixture.h"
#include "tests/temporary_folder.h"

// Levels of detail of a mesh whose vertices have numbers of 64 bits.

namespace isobrick::test {
namespace {

namespace fs = std::filesystem;

std::map<std::string, std::string> files_of(const fs::path& folder) {
  std::map<std::string, std::string> files;
  for (const auto& entry : fs::recursive_directory_iterator(folder))
    if (entry.is_regular_file()) {
      std::ifstream in(entry.path(), std::ios::binary);
      files[fs::relative(entry.path(), folder).string()] =
          std::string(std::istreambuf_iterator<char>(in), {});
    }
  return files;
}

TEST(WideLevels, AreThoseOfTheSameMesh) {
  const Mesh mesh = make_torus(300);
  std::vector<WideTriangle> triangles;
  for (const Triangle& t : mesh.triangles) triangles.push_back({t[0], t[1], t[2]});
  for (const char* name : {"mesh.3dtiles", "mesh.neuroglancer"}) {
    const TemporaryFolder folder;
    const auto make = [&](bool wide) {
      // Little memory, so that most of the mesh lies in scratch files.
      const auto sink = create_mesh_file(folder / name, {.force = true, .memory = 1 << 20});
      EXPECT_TRUE(sink->takes_wide());
      sink->begin({.wide = wide});
      MeshChunk chunk{.positions = mesh.positions.span()};
      if (wide)
        chunk.wide_triangles = triangles;
      else
        chunk.triangles = mesh.triangles.span();
      sink->write(chunk);
      sink->finish();
      return files_of(folder / name);
    };
    try {
      const auto narrow = make(false);
      EXPECT_GE(narrow.size(), 4u);
      EXPECT_TRUE(make(true) == narrow) << name;
    } catch (const UsageError&) {
      EXPECT_EQ(std::string(name), "mesh.neuroglancer") << "only that needs a library";
    }
  }
}

}  // namespace
}  // namespace isobrick::test
