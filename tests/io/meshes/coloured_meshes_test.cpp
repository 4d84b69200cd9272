#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include <isobrick/error.h>
#include <isobrick/mesh_file_sink.h>
#include "io/meshes/gltf/glb_scene.h"
#include "tests/io/bytes/temp_dir.h"
#include "tests/io/meshes/mesh_files.h"

// Colours of vertices and names and colours of meshes, as PLY, OBJ and GLB have them.
namespace isobrick::inline v0 {
namespace {

nlohmann::json scene_of_glb(const std::string& bytes) {
  std::uint32_t size = 0;
  std::memcpy(&size, bytes.data() + 12, 4);
  return nlohmann::json::parse(bytes.substr(20, size));
}

/// A colour that a vertex of the ball does not share with its neighbours.
VertexColour colour_of(std::size_t vertex) {
  return {static_cast<std::uint8_t>(vertex % 256), static_cast<std::uint8_t>(vertex / 7 % 256),
          static_cast<std::uint8_t>(255 - vertex % 251), 255};
}

/// A ball whose vertices have colours, in chunks, and an attribute.
void write_coloured(const std::string& path, const MeshFileOptions& options) {
  const TestMesh ball = make_ball({1, 2, 3}, 1, kRings);
  const auto sink = create_mesh_file(path, options);
  sink->begin({.has_normals = true, .attributes = {"height"}, .has_colours = true});
  const std::size_t half = ball.positions.size() / 2;
  for (const std::size_t first : {std::size_t{0}, half}) {
    MeshChunk chunk = ball.chunk(first);
    chunk.positions = chunk.positions.subspan(first, half);
    chunk.normals = chunk.normals.subspan(first, half);
    if (first == 0) chunk.triangles = {};
    std::vector<VertexColour> colours;
    std::vector<float> heights;
    for (std::size_t i = first; i < first + half; ++i) {
      colours.push_back(colour_of(i));
      heights.push_back(ball.positions[i].z);
    }
    const VertexAttribute height{"height", heights};
    chunk.colours = colours;
    chunk.attributes = {&height, 1};
    sink->write(chunk);
  }
  sink->finish();
}

class ColouredMesh : public testing::TestWithParam<std::string> {};

TEST_P(ColouredMesh, VerticesKeepTheirColours) {
  const TempDir dir;
  const std::string path = dir / GetParam();
  MeshFileOptions options;
  options.quantize = GetParam() == "quantized.glb";
  options.compress = GetParam() == "compressed.glb";
  try {
    write_coloured(path, options);
  } catch (const UsageError& error) {
    GTEST_SKIP() << error.what();  // without meshoptimizer
  }
  const TestMesh ball = make_ball({1, 2, 3}, 1, kRings);
  const std::vector<VertexColour> colours = colours_of(path);
  ASSERT_EQ(colours.size(), 3 * ball.triangles.size());
  for (std::size_t t = 0; t < ball.triangles.size(); ++t) {
    std::array<VertexColour, 3> corners, expected;
    for (std::size_t i = 0; i < 3; ++i) {
      corners[i] = colours[3 * t + i];
      expected[i] = colour_of(ball.triangles[t][i]);
    }
    // A compressed triangle may be turned.
    std::sort(corners.begin(), corners.end());
    std::sort(expected.begin(), expected.end());
    ASSERT_EQ(corners, expected);
  }
  if (options.compress) return;
  expect_ball(path, true, options.quantize ? 2.1 / 65535 : 1e-6);
}

INSTANTIATE_TEST_SUITE_P(Formats, ColouredMesh,
                         testing::Values("a.ply", "a.obj", "a.glb", "quantized.glb",
                                         "compressed.glb"),
                         [](const auto& instance) {
                           std::string name = instance.param;
                           std::replace(name.begin(), name.end(), '.', '_');
                           return name;
                         });

TEST(ColouredMeshes, OthersIgnoreColours) {
  const TempDir dir;
  for (const char* name : {"a.stl", "a.vtp", "a.pvtp"}) {
    write_coloured(dir / name, {});
    EXPECT_TRUE(colours_of(dir / name).empty()) << name;
    if (std::string(name) != "a.stl") expect_ball(dir / name, true, 1e-6);
  }
}

TEST(ColouredMeshes, AGlbHasThemInLinearLightOnWhite) {
  const TempDir dir;
  write_coloured(dir / "a.glb", {});
  const nlohmann::json scene = scene_of_glb(dir.read("a.glb"));
  const nlohmann::json& attributes = scene["meshes"][0]["primitives"][0]["attributes"];
  const nlohmann::json& colours = scene["accessors"][attributes["COLOR_0"].get<std::size_t>()];
  EXPECT_EQ(colours["componentType"], 5123);
  EXPECT_EQ(colours["type"], "VEC4");
  EXPECT_EQ(colours["normalized"], true);
  EXPECT_EQ(scene["bufferViews"][0]["byteStride"], 24 + 4 + 8);
  EXPECT_EQ(scene["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"],
            nlohmann::json({1, 1, 1, 1}));
}

TEST(ColouredMeshes, RowsThatGrowWhereTheyAreStoredAreAppended) {
  // As many as a buffer holds before they are stored: a colour takes 4 bytes there and 8 in a file.
  const GlbVertices vertices{.colours = true};
  std::vector<std::byte> rows(FileWriter::kBuffer / vertices.float_row_bytes() *
                              vertices.float_row_bytes());
  for (std::size_t i = 0; i < rows.size(); ++i) rows[i] = static_cast<std::byte>(i * i % 61);
  const std::size_t count = rows.size() / vertices.float_row_bytes();
  std::vector<std::byte> expected(count * vertices.row_bytes()), found(expected.size());
  ASSERT_GT(expected.size(), FileWriter::kBuffer);
  const Bounds3f bounds = vertices.store(rows, expected.data());
  FileWriter out = open_scratch_beside("-");
  const Bounds3f appended = vertices.append(out, rows);
  ASSERT_EQ(out.size(), expected.size());
  out.flush();
  out.share().read_at(0, found);
  EXPECT_TRUE(found == expected);
  EXPECT_EQ(appended.lo, bounds.lo);
  EXPECT_EQ(appended.hi, bounds.hi);
}

TEST(ColouredMeshes, OfLabelsHaveANameAndAColour) {
  const TempDir dir;
  const VertexColour colour{255, 0, 188, 255};
  const MeshFileOptions options{.name = "left \"lung\"\nv 1 2 3", .colour = colour};
  const TestMesh ball = make_ball({1, 2, 3}, 1, kRings);
  for (const char* name : {"a.ply", "a.obj", "a.glb", "a.vtp", "a.stl"}) {
    const auto sink = create_mesh_file(dir / name, options);
    if (sink->indexing() == Indexing::welded) write_ball(*sink);
  }
  for (const char* name : {"a.ply", "a.obj"}) {
    const std::vector<VertexColour> colours = colours_of(dir / name);
    ASSERT_EQ(colours.size(), 3 * ball.triangles.size()) << name;
    EXPECT_TRUE(std::all_of(colours.begin(), colours.end(), [&](const VertexColour& c) {
      return c == colour;
    })) << name;
    expect_ball(dir / name, true, 1e-6);
  }
  EXPECT_TRUE(contains(dir.read("a.ply"), "\ncomment name left \"lung\" v 1 2 3\n"));
  EXPECT_TRUE(dir.read("a.obj").starts_with("# Isobrick\no left \"lung\" v 1 2 3\nv "));
  const nlohmann::json scene = scene_of_glb(dir.read("a.glb"));
  EXPECT_EQ(scene["nodes"][0]["name"], options.name);
  EXPECT_EQ(scene["meshes"][0]["name"], options.name);
  EXPECT_EQ(scene["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"],
            nlohmann::json({1, 0, linear_light(188), 1}));
  EXPECT_TRUE(colours_of(dir / "a.glb").empty());
}

TEST(ColouredMeshes, NamesThatAreNoUtf8AreReplacedInAGlb) {
  const TempDir dir;
  const auto sink = create_mesh_file(dir / "a.glb", {.name = "H\xfc"
                                                             "fte"});
  write_ball(*sink);
  EXPECT_EQ(scene_of_glb(dir.read("a.glb"))["nodes"][0]["name"],
            "H\xef\xbf\xbd"
            "fte");
}

}  // namespace
}  // namespace isobrick
