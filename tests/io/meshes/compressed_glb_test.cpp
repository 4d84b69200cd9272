#include <gtest/gtest.h>
#include <meshoptimizer.h>

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "io/meshes/glb_compressor.h"
#include "io/meshes/glb_sink.h"
#include "tests/io/bytes/temp_dir.h"
#include "tests/io/meshes/mesh_files.h"
#include "tests/io/meshes/turned_triangles.h"

// EXT_meshopt_compression: files are decoded by the library, as their JSON describes them.
namespace isobrick::inline v0 {
namespace {

using nlohmann::json;

/// A GLB taken apart, with the views as they are decoded.
struct Decoded {
  json scene;
  std::string binary;
  std::vector<std::string> views;
};

Decoded decode(const std::string& folder, const std::string& glb) {
  std::uint32_t size = 0, binary = 0;
  std::memcpy(&size, glb.data() + 12, 4);
  Decoded file{json::parse(glb.substr(20, size)), {}, {}};
  if (glb.size() > 20 + size) {
    std::memcpy(&binary, glb.data() + 20 + size, 4);
    EXPECT_EQ(glb.size(), 28 + size + binary);
    EXPECT_EQ(binary, file.scene["buffers"][0]["byteLength"]);
    file.binary = glb.substr(28 + size, binary);
  }
  for (const json& view : file.scene.value("bufferViews", json::array())) {
    const json& fallback = file.scene["buffers"][view["buffer"].get<std::size_t>()];
    EXPECT_TRUE(fallback["extensions"]["EXT_meshopt_compression"]["fallback"]);
    EXPECT_LE(view["byteOffset"].get<std::uint64_t>() + view["byteLength"].get<std::uint64_t>(),
              fallback["byteLength"].get<std::uint64_t>());
    const json& packed = view["extensions"]["EXT_meshopt_compression"];
    const json& source = file.scene["buffers"][packed["buffer"].get<std::size_t>()];
    std::string bytes = file.binary;
    if (source.contains("uri")) {
      std::ifstream in(folder + "/" + source["uri"].get<std::string>(), std::ios::binary);
      bytes.assign(std::istreambuf_iterator<char>(in), {});
    }
    EXPECT_EQ(bytes.size(), source["byteLength"]);
    const std::string encoded = bytes.substr(packed["byteOffset"], packed["byteLength"]);
    const auto* from = reinterpret_cast<const unsigned char*>(encoded.data());
    const std::size_t count = packed["count"], stride = packed["byteStride"];
    EXPECT_EQ(view["byteLength"], count * stride);
    std::string& to = file.views.emplace_back(count * stride, '\0');
    if (packed["mode"] == "ATTRIBUTES") {
      EXPECT_EQ(view["byteStride"], stride);
      EXPECT_EQ(from[0], 0xa0) << "the version that the extension names";
      EXPECT_EQ(meshopt_decodeVertexBuffer(to.data(), count, stride, from, encoded.size()), 0);
    } else {
      EXPECT_FALSE(view.contains("byteStride"));
      EXPECT_EQ(packed["mode"], "TRIANGLES");
      EXPECT_EQ(from[0], 0xe1);
      EXPECT_EQ(meshopt_decodeIndexBuffer(to.data(), count, stride, from, encoded.size()), 0);
    }
  }
  return file;
}

/// Writes a mesh in pieces of `chunk` triangles, with their vertices before them.
void write(MeshSink&& sink, const TestMesh& mesh, bool normals, std::size_t chunk,
           bool attributes = false, bool wide = false) {
  MeshHeader header{.has_normals = normals, .wide = wide};
  if (attributes) header.attributes = {"height"};
  sink.begin(header);
  std::size_t v = 0;
  for (std::size_t t = 0; t < mesh.triangles.size(); t += chunk) {
    const auto triangles =
        std::span(mesh.triangles).subspan(t).first(std::min(chunk, mesh.triangles.size() - t));
    std::size_t end = v;
    for (const Triangle& triangle : triangles)
      for (const std::uint32_t vertex : triangle) end = std::max(end, std::size_t{vertex} + 1);
    if (t + chunk >= mesh.triangles.size()) end = mesh.positions.size();
    MeshChunk piece{.first_vertex = v};
    piece.positions = std::span(mesh.positions).subspan(v, end - v);
    if (normals) piece.normals = std::span(mesh.normals).subspan(v, end - v);
    std::vector<WideTriangle> wide_triangles;
    for (const Triangle& one : triangles) wide_triangles.push_back({one[0], one[1], one[2]});
    if (wide)
      piece.wide_triangles = wide_triangles;
    else
      piece.triangles = triangles;
    std::vector<float> heights;
    for (const Vec3f& p : piece.positions) heights.push_back(p.z);
    const VertexAttribute height{"height", heights};
    if (attributes) piece.attributes = {&height, 1};
    sink.write(piece);
    v = end;
  }
  sink.finish();
}

TEST(CompressedGlb, HoldsTheSameNumbers) {
  const TestMesh ball = make_ball({1000.125f, -2, 3e-3f}, 7, 40);
  for (const bool quantize : {false, true})
    for (const bool normals : {false, true}) {
      const TempDir dir;
      write(GlbSink(dir / "plain.glb", false, {.quantize = quantize}), ball, normals, 777);
      write(GlbSink(dir / "a.glb", false, {.quantize = quantize, .compress = true}), ball, normals,
            777);
      EXPECT_EQ(turned(dir / "a.glb"), turned(dir / "plain.glb"));
      const std::string bytes = dir.read("a.glb");
      EXPECT_LT(bytes.size(), dir.read("plain.glb").size() * 7 / 10);
      const Decoded file = decode(dir / ".", bytes);
      EXPECT_EQ(file.views.size(), normals ? 3U : 2U);
      const json required = file.scene["extensionsRequired"];
      EXPECT_EQ(required, quantize ? json({"KHR_mesh_quantization", "EXT_meshopt_compression"})
                                   : json({"EXT_meshopt_compression"}));
      EXPECT_EQ(file.scene["extensionsUsed"], required);
      const json& positions = file.scene["accessors"][0];
      EXPECT_EQ(positions["count"], ball.positions.size());
      EXPECT_EQ(file.views[0].size(), ball.positions.size() * (quantize ? 8 : 12));
    }
}

/// The bounds of an accessor are those of what its view decodes to.
TEST(CompressedGlb, BoundsAreThoseOfEachPrimitive) {
  const TempDir dir;
  const TestMesh ball = make_ball({5, -2, 3}, 7, 40);
  write(GlbSink(dir / "a.glb", false, {.compress = true, .part_triangles = 1000}), ball, true, 300);
  const Decoded file = decode(dir / ".", dir.read("a.glb"));
  std::size_t triangles = 0;
  for (const json& primitive : file.scene["meshes"][0]["primitives"]) {
    const json& accessor =
        file.scene["accessors"][primitive["attributes"]["POSITION"].get<std::size_t>()];
    const std::string& view = file.views[accessor["bufferView"]];
    std::vector<Vec3f> positions(view.size() / sizeof(Vec3f));
    std::memcpy(positions.data(), view.data(), view.size());
    Bounds3f bounds;
    bounds.include(positions);
    for (int axis = 0; axis < 3; ++axis) {
      EXPECT_EQ(accessor["min"][axis].get<float>(), bounds.lo[axis]);
      EXPECT_EQ(accessor["max"][axis].get<float>(), bounds.hi[axis]);
    }
    triangles += file.scene["accessors"][primitive["indices"].get<std::size_t>()]["count"]
                     .get<std::size_t>() /
                 3;
  }
  EXPECT_EQ(triangles, ball.triangles.size());
}

TEST(CompressedGlb, PartsAreInOneFileOrInMany) {
  const TestMesh ball = make_ball({1, 2, 3}, 7, 40);
  for (const bool quantize : {false, true}) {
    const TempDir dir;
    write(GlbSink(dir / "whole.glb", false, {.quantize = quantize}), ball, true, 500);
    write(GlbSink(dir / "one.glb", false,
                  {.quantize = quantize, .compress = true, .part_triangles = 1000}),
          ball, true, 500);
    GlbOptions cut{.quantize = quantize, .compress = true, .file_bytes = 10'000};
    cut.part_triangles = 1000;
    write(GlbSink(dir / "many.glb", false, cut), ball, true, 500);
    const auto expected = turned(dir / "whole.glb");
    EXPECT_EQ(turned(dir / "one.glb"), expected);
    EXPECT_EQ(turned(dir / "many.glb"), expected);
    const std::size_t parts = (ball.triangles.size() + 999) / 1000;
    for (const char* name : {"one.glb", "many.glb"})
      EXPECT_EQ(decode(dir / ".", dir.read(name)).scene["meshes"][0]["primitives"].size(), parts);
    EXPECT_LT(dir.read("many.glb").size(), 10'000U);
    EXPECT_FALSE(std::filesystem::exists(dir / "one.glb.parts"));
    EXPECT_TRUE(std::filesystem::exists(dir / "many.glb.parts"));
  }
}

TEST(CompressedGlb, ChunksNeverShow) {
  const TempDir dir;
  const TestMesh ball = make_ball({1, 2, 3}, 7, 40);
  const GlbOptions options{.compress = true, .part_triangles = 3000};
  write(GlbSink(dir / "a.glb", false, options), ball, true, 100);
  for (const std::size_t chunk : {std::size_t{77}, std::size_t{2000}, std::size_t{1} << 30}) {
    write(GlbSink(dir / "b.glb", true, options), ball, true, chunk);
    EXPECT_EQ(dir.read("b.glb"), dir.read("a.glb"));
  }
}

TEST(CompressedGlb, NumbersOf64BitsNeverShow) {
  const TempDir dir;
  const TestMesh ball = make_ball({1, 2, 3}, 7, 40);
  const GlbOptions options{.compress = true, .part_triangles = 1000};
  write(GlbSink(dir / "a.glb", false, options), ball, true, 500);
  write(GlbSink(dir / "b.glb", false, options), ball, true, 500, false, true);
  EXPECT_EQ(dir.read("b.glb"), dir.read("a.glb"));
}

TEST(CompressedGlb, AttributesAreKept) {
  const TempDir dir;
  const TestMesh ball = make_ball({1, 2, 3}, 1, 20);
  write(GlbSink(dir / "a.glb", false, {.quantize = true, .compress = true}), ball, true, 500, true);
  const Decoded file = decode(dir / ".", dir.read("a.glb"));
  const json& attributes = file.scene["meshes"][0]["primitives"][0]["attributes"];
  const std::string& heights =
      file.views[file.scene["accessors"][attributes["_HEIGHT"].get<std::size_t>()]["bufferView"]];
  std::vector<float> values(heights.size() / 4), expected;
  std::memcpy(values.data(), heights.data(), heights.size());
  for (const Vec3f& p : ball.positions) expected.push_back(p.z);
  std::sort(values.begin(), values.end());
  std::sort(expected.begin(), expected.end());
  EXPECT_EQ(values, expected);
}

/// A mesh whose triangles share nothing has more vertices than a primitive takes. Those that no
/// triangle names are in none.
TEST(CompressedGlb, ManyVerticesMakeMorePrimitives) {
  const TempDir dir;
  TestMesh soup;
  for (std::uint32_t i = 0; i < 600; ++i) {
    const auto x = static_cast<float>(i);
    for (const Vec3f p : {Vec3f{x, 0, 0}, Vec3f{x, 1, 0}, Vec3f{x, 0, 1}, Vec3f{x, 9, 9}}) {
      soup.positions.push_back(p);
      soup.normals.push_back({1, 0, 0});
    }
    soup.triangles.push_back({4 * i, 4 * i + 1, 4 * i + 2});
  }
  write(GlbSink(dir / "plain.glb", false), soup, true, 50);
  write(GlbSink(dir / "a.glb", false, {.compress = true, .part_triangles = 400}), soup, true, 50);
  EXPECT_EQ(turned(dir / "a.glb"), turned(dir / "plain.glb"));
  const Decoded file = decode(dir / ".", dir.read("a.glb"));
  std::size_t vertices = 0;
  for (const json& primitive : file.scene["meshes"][0]["primitives"]) {
    const std::size_t count =
        file.scene["accessors"][primitive["attributes"]["POSITION"].get<std::size_t>()]["count"];
    EXPECT_LE(count, 300U);
    vertices += count;
  }
  EXPECT_EQ(vertices, 1800U);
  // Now all share a vertex, which each primitive numbers anew.
  for (Triangle& triangle : soup.triangles) triangle[2] = 3;
  write(GlbSink(dir / "plain.glb", true), soup, true, 50);
  write(GlbSink(dir / "a.glb", true, {.compress = true, .part_triangles = 400}), soup, true, 50);
  EXPECT_EQ(turned(dir / "a.glb"), turned(dir / "plain.glb"));
}

TEST(CompressedGlb, OddMeshesAreKept) {
  const TempDir dir;
  TestMesh odd;
  odd.positions = {{5, 5, 5}, {6, 5, 5}, {5, 6, 5}};
  odd.triangles = {{0, 1, 2}, {0, 0, 1}, {2, 2, 2}, {0, 1, 2}, {2, 1, 0}};
  write(GlbSink(dir / "plain.glb", false), odd, false, 5);
  write(GlbSink(dir / "a.glb", false, {.compress = true}), odd, false, 5);
  EXPECT_EQ(turned(dir / "a.glb"), turned(dir / "plain.glb"));
  write(GlbSink(dir / "none.glb", false, {.compress = true}), {}, true, 1);
  write(GlbSink(dir / "empty.glb", false), {}, true, 1);
  EXPECT_EQ(dir.read("none.glb"), dir.read("empty.glb"));
}

TEST(CompressedGlb, AFinishedSinkSaysHowLongTheMeshIs) {
  const TempDir dir;
  const TestMesh ball = make_ball({1, 2, 3}, 7, 40);
  for (const std::uint64_t file_bytes : {std::uint64_t{1} << 30, std::uint64_t{10'000}}) {
    GlbSink sink(dir / "a.glb", true,
                 {.compress = true, .file_bytes = file_bytes, .part_triangles = 1000});
    sink.begin({.has_normals = true});
    sink.write(ball.chunk());
    sink.finish();
    std::uint64_t bytes = dir.read("a.glb").size();
    if (std::filesystem::exists(dir / "a.glb.parts"))
      for (const auto& part : std::filesystem::directory_iterator(dir / "a.glb.parts"))
        bytes += part.file_size();
    EXPECT_EQ(sink.bytes(), bytes);
  }
}

/// Indices of 16 bits and filters of normals, as other programs write them.
TEST(CompressedGlb, ReadsWhatOthersWrite) {
  const TempDir dir;
  const std::array<Vec3f, 3> positions{Vec3f{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  const std::array<float, 12> normals{0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0};
  std::array<std::int8_t, 12> filtered{};
  meshopt_encodeFilterOct(filtered.data(), 3, 4, 8, normals.data());
  const unsigned int indices[] = {0, 1, 2};
  std::vector<unsigned char> buffer(1000);
  std::vector<std::pair<std::size_t, std::size_t>> ranges;
  std::size_t at = 0;
  const auto add = [&](std::size_t size) {
    ASSERT_GT(size, 0U);
    ranges.emplace_back(at, size);
    at += (size + 3) / 4 * 4;
  };
  meshopt_encodeVertexVersion(0);
  add(meshopt_encodeVertexBuffer(buffer.data() + at, 1000 - at, positions.data(), 3, 12));
  add(meshopt_encodeVertexBuffer(buffer.data() + at, 1000 - at, filtered.data(), 3, 4));
  add(meshopt_encodeIndexSequence(buffer.data() + at, 1000 - at, indices, 3));
  const auto view = [&](std::size_t i, int stride, const std::string& how) {
    return R"({"buffer":1,"byteLength":)" + std::to_string(3 * stride) +
           (i < 2 ? R"(,"byteStride":)" + std::to_string(stride) : "") +
           R"(,"extensions":{"EXT_meshopt_compression":{"buffer":0,"byteOffset":)" +
           std::to_string(ranges[i].first) + R"(,"byteLength":)" +
           std::to_string(ranges[i].second) + R"(,"byteStride":)" + std::to_string(stride) +
           R"(,"count":3,)" + how + "}}}";
  };
  const std::string scene =
      R"({"extensionsRequired":["EXT_meshopt_compression","KHR_mesh_quantization"],)"
      R"("scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],)"
      R"("meshes":[{"primitives":[{"attributes":{"POSITION":0,"NORMAL":1},"indices":2}]}],)"
      R"("accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"},)"
      R"({"bufferView":1,"componentType":5120,"normalized":true,"count":3,"type":"VEC3"},)"
      R"({"bufferView":2,"componentType":5123,"count":3,"type":"SCALAR"}],"bufferViews":[)" +
      view(0, 12, R"("mode":"ATTRIBUTES")") + "," +
      view(1, 4, R"("mode":"ATTRIBUTES","filter":"OCTAHEDRAL")") + "," +
      view(2, 2, R"("mode":"INDICES")") + R"(],"buffers":[{"byteLength":)" + std::to_string(at) +
      R"(},{"byteLength":54,"extensions":{"EXT_meshopt_compression":{"fallback":true}}}]})";
  const std::string binary(reinterpret_cast<const char*>(buffer.data()), at);
  open_mesh_file(dir.write("a.glb", glb(scene, binary)))
      ->read({}, [&](const MeshChunk& chunk, Vec3d) {
        ASSERT_EQ(chunk.positions.size(), 3U);
        ASSERT_EQ(chunk.normals.size(), 3U);
        for (std::size_t i = 0; i < 3; ++i) {
          EXPECT_EQ(chunk.positions[i], positions[i]);
          for (int axis = 0; axis < 3; ++axis)
            EXPECT_NEAR(chunk.normals[i][axis], normals[4 * i + static_cast<std::size_t>(axis)],
                        0.02);
        }
      });
}

TEST(CompressedGlb, DamageIsSaid) {
  const TempDir dir;
  const TestMesh ball = make_ball({1, 2, 3}, 1, 20);
  write(GlbSink(dir / "a.glb", false, {.compress = true}), ball, true, 5000);
  const std::string good = dir.read("a.glb");
  read_all(dir / "a.glb");
  const std::vector<std::pair<std::string, std::string>> changes{
      {R"("mode":"ATTRIBUTES")", R"("mode":"INDICES"   )"},
      {R"("mode":"TRIANGLES")", R"("mode":"TRIANGLEZ")"},
      {R"("byteStride":12,"mode")", R"("byteStride":99,"mode")"},
      {R"("byteStride":12,"mode")", R"("byteStride": 0,"mode")"},
      {R"("byteStride":12,"mode")", R"("byteStride":-1,"mode")"},
      {R"("count":840}}})", R"("count":841}}})"},
      {R"("buffer":0)", R"("buffer":7)"}};
  for (const auto& [from, to] : changes) {
    std::string bad = good;
    const std::size_t at = bad.find(from);
    ASSERT_NE(at, bad.npos) << from;
    bad.replace(at, from.size(), to);
    EXPECT_TRUE(contains(message_of<Error>([&] { read_all(dir.write("b.glb", bad)); }), "b.glb"))
        << to;
  }
  // Bytes of the codec: read as something else or refused, and nothing worse.
  std::uint32_t size = 0;
  std::memcpy(&size, good.data() + 12, 4);
  for (std::size_t at = 28 + size; at < good.size(); at += 97) {
    std::string bad = good;
    bad[at] = static_cast<char>(bad[at] ^ 0x55);
    try {
      read_all(dir.write("b.glb", bad));
    } catch (const Error&) {
    }
  }
}

TEST(CompressedGlb, ItsMemoryIsSome26MiB) {
  const std::uint64_t more = GlbSink::memory_with({.compress = true}) - GlbSink::memory_with({});
  EXPECT_GE(more, std::uint64_t{20} << 20);
  EXPECT_LE(more, std::uint64_t{32} << 20);
}

}  // namespace
}  // namespace isobrick
