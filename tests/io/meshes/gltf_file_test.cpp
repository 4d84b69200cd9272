#include <gtest/gtest.h>

#include <array>
#include <cstring>
#include <filesystem>
#include <string>

#include "io/meshes/glb_sink.h"
#include "tests/io/bytes/base64_text.h"
#include "tests/io/bytes/temp_dir.h"
#include "tests/io/meshes/mesh_files.h"

namespace isobrick::inline v0 {
namespace {

/// A GLB's scene as a .gltf whose buffer is at `uri`.
std::string scene_of(const std::string& glb_bytes, const std::string& uri) {
  std::uint32_t size = 0;
  std::memcpy(&size, glb_bytes.data() + 12, sizeof(size));
  std::string scene = glb_bytes.substr(20, size);
  const std::string buffers = R"("buffers":[{)";
  return scene.insert(scene.find(buffers) + buffers.size(), R"("uri":")" + uri + R"(",)");
}

TEST(GltfFile, NormalsStayAcrossTheSurfaceWhereAxesAreScaledDifferently) {
  const TempDir dir;
  for (const bool mirrored : {false, true}) {
    const std::string json =
        std::string(R"({"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0,"scale":)") +
        (mirrored ? "[-1,2,4]" : "[1,2,4]") +
        R"(}],"meshes":[{"primitives":[{"attributes":{"POSITION":0,"NORMAL":1}}]}],)"
        R"("accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"},{"bufferView":1,"componentType":5126,"count":3,"type":"VEC3"}],)"
        R"("bufferViews":[{"buffer":0,"byteLength":36},{"buffer":0,"byteOffset":36,"byteLength":36}],"buffers":[{"byteLength":72}]})";
    const Vec3f normal{1, 1, 1};  // of x + y + z = 1
    const std::array<Vec3f, 6> numbers{Vec3f{1, 0, 0}, {0, 1, 0}, {0, 0, 1},
                                       normal,         normal,    normal};
    const std::string binary(reinterpret_cast<const char*>(numbers.data()), sizeof(numbers));
    open_mesh_file(dir.write("a.glb", glb(json, binary)))->read({}, [&](const MeshChunk& c, Vec3d) {
      ASSERT_EQ(c.normals.size(), 3U);
      for (const Vec3f n : c.normals) {
        EXPECT_NEAR(dot(n, c.positions[1] - c.positions[0]), 0, 1e-6);
        EXPECT_NEAR(dot(n, c.positions[2] - c.positions[0]), 0, 1e-6);
        EXPECT_GT(n.z, 0);
        EXPECT_EQ(n.x > 0, !mirrored);
      }
    });
  }
}

TEST(GltfFile, AGlbOfOthersIsInMetres) {
  const TempDir dir;
  const auto unit = [&](const std::string& asset) {
    return open_mesh_file(dir.write("a.glb", glb(R"({"asset":)" + asset + "}", "")))->info().unit;
  };
  EXPECT_EQ(unit(R"({"version":"2.0","generator":"Blender"})"), "meter");
  EXPECT_EQ(unit(R"({"version":"2.0"})"), "meter");
  EXPECT_EQ(unit(R"({"version":"2.0","generator":"Isobrick"})"), "");
  EXPECT_EQ(unit(R"({"version":"2.0","extras":{"unit":"banana"}})"), "meter");
  EXPECT_EQ(unit(R"({"version":"2.0","extras":[1]})"), "meter");
  message_of<Error>([&] { unit("7"); });
}

TEST(GltfFile, ReadsScenesInText) {
  const TempDir dir;
  GlbSink sink(dir / "a.glb", false);
  write_ball(sink, true, "micrometer");
  const std::string bytes = dir.read("a.glb");
  std::uint32_t size = 0;
  std::memcpy(&size, bytes.data() + 12, sizeof(size));
  const std::string buffer = bytes.substr(20 + size + 8);
  dir.write("a b.bin", buffer);
  const std::string data = "data:application/octet-stream;base64," + base64(buffer);
  for (const std::string& uri : {std::string("a%20b.bin"), data}) {
    const std::string path = dir.write("b.gltf", scene_of(bytes, uri));
    expect_ball(path, true, 1e-6);
    EXPECT_EQ(open_mesh_file(path)->info().unit, "micrometer");
  }
  for (const std::string& uri :
       {std::string("gone.bin"), std::string("../a b.bin"), std::string("data:,abc"),
        data.substr(0, data.size() / 2), "data:;base64,*" + data.substr(40)}) {
    const std::string path = dir.write("c.gltf", scene_of(bytes, uri));
    EXPECT_TRUE(contains(message_of<Error>([&] { read_all(path); }),
                         uri == "gone.bin" ? "gone.bin" : "c.gltf"));
  }
  for (const std::string text : {"", "[]", "{", "ply"})
    EXPECT_TRUE(
        contains(message_of<Error>([&] { open_mesh_file(dir.write("d.gltf", text)); }), "d.gltf"));
}

TEST(GltfFile, ReadsColoursOfScenes) {
  const TempDir dir;
  // Linear: a half of the light is 188 of sRGB's 255.
  const std::array<float, 9> positions{0, 0, 0, 1, 0, 0, 0, 1, 0};
  const std::array<std::uint8_t, 12> colours{255, 0, 0, 9, 0, 255, 0, 9, 0, 0, 128, 9};
  std::string binary(reinterpret_cast<const char*>(positions.data()), sizeof(positions));
  binary.append(reinterpret_cast<const char*>(colours.data()), sizeof(colours));
  const std::string json =
      R"({"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],)"
      R"("meshes":[{"primitives":[{"attributes":{"POSITION":0,"COLOR_0":1}}]}],)"
      R"("accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"},)"
      R"({"bufferView":1,"componentType":5121,"normalized":true,"count":3,"type":"VEC4"}],)"
      R"("bufferViews":[{"buffer":0,"byteLength":36},{"buffer":0,"byteOffset":36,"byteLength":12}],)"
      R"("buffers":[{"byteLength":48}]})";
  EXPECT_EQ(colours_of(dir.write("a.glb", glb(json, binary))),
            (std::vector<VertexColour>{{255, 0, 0, 255}, {0, 255, 0, 255}, {0, 0, 188, 255}}));
}

TEST(GltfFile, DamagedScenesAreSaid) {
  const TempDir dir;
  const std::string good =
      R"({"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],"meshes":[{"primitives":[{"attributes":{"POSITION":0},"indices":1}]}],)"
      R"("accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"},{"bufferView":1,"componentType":5125,"count":3,"type":"SCALAR"}],)"
      R"("bufferViews":[{"buffer":0,"byteLength":36},{"buffer":0,"byteOffset":36,"byteLength":12}],"buffers":[{"byteLength":48}]})";
  const std::string binary(48, '\0');
  read_all(dir.write("good.glb", glb(good, binary)));
  const std::vector<std::pair<std::string, std::string>> changes{
      {R"("count":3,"type":"VEC3")", R"("count":4,"type":"VEC3")"},
      {R"("count":3,"type":"VEC3")", R"("count":18446744073709551615,"type":"VEC3")"},
      {R"("count":3,"type":"VEC3")", R"("count":-1,"type":"VEC3")"},
      {R"("byteOffset":36)", R"("byteOffset":18446744073709551600)"},
      {R"("byteOffset":36)", R"("byteOffset":40)"},
      {R"("nodes":[{"mesh":0}])", R"("nodes":[{"children":[0]}])"},
      {R"("nodes":[{"mesh":0}])", R"("nodes":[{"mesh":5}])"},
      {R"("nodes":[{"mesh":0}])", R"("nodes":[{"mesh":0,"scale":[1,1]}])"},
      {R"("buffers":[{"byteLength":48}])", R"("buffers":[{"byteLength":48,"uri":"../x.bin"}])"},
      {R"("buffers":[{"byteLength":48}])", R"("buffers":[{"byteLength":48,"uri":"gone.bin"}])"},
      {R"("componentType":5125)", R"("componentType":5126)"},
      {R"("componentType":5125)", R"("componentType":7)"},
      {R"("indices":1)", R"("indices":1,"mode":5)"},
      {R"("type":"VEC3")", R"("type":"VEC2")"},
      {R"("scenes")", R"("extensionsRequired":["EXT_x"],"scenes")"},
      {R"("scenes")", R"("scenes)"},
  };
  for (const auto& [from, to] : changes) {
    std::string json = good;
    json.replace(json.find(from), from.size(), to);
    const std::string path = dir.write("bad.glb", glb(json, binary));
    EXPECT_FALSE(message_of<Error>([&] { read_all(path); }).empty()) << to;
  }
  std::string far = binary;
  far[44] = 9;
  message_of<Error>([&] { read_all(dir.write("far.glb", glb(good, far))); });
}

TEST(GltfFile, ScenesNestedTooDeeplyAreRefused) {
  const TempDir dir;
  const auto nested = [&](std::size_t arrays) {
    const std::string json =
        R"({"extras":)" + std::string(arrays, '[') + std::string(arrays, ']') + "}";
    return dir.write("nested.glb", glb(json, ""));
  };
  EXPECT_EQ(open_mesh_file(nested(63))->info().faces, 0U);
  for (const std::size_t arrays : {64U, 1U << 20}) {
    const std::string message = message_of<Error>([&] { open_mesh_file(nested(arrays)); });
    EXPECT_TRUE(contains(message, "nested more than 64 levels deep")) << message;
    EXPECT_TRUE(contains(message, "nested.glb")) << message;
  }
}

}  // namespace
}  // namespace isobrick
