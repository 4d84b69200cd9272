#include <gtest/gtest.h>

#include <filesystem>
#include <functional>
#include <map>
#include <memory>

#include "io/meshes/glb_sink.h"
#include "io/meshes/obj_sink.h"
#include "io/meshes/ply_sink.h"
#include "io/meshes/vtp_layout.h"
#include "io/meshes/vtp_sink.h"
#include "mesh_chunks.h"
#include "mesh_reader.h"

// Every format against the same mesh as PLY has it.
namespace isobrick::inline v0 {
namespace {

namespace fs = std::filesystem;

/// What PLY has, read by the test's reader.
TestMesh as_ply(const TempDir& dir, const Chunks& chunks, bool normals) {
  PlySink sink(dir / "reference.ply", true);
  write(sink, chunks, normals);
  return read_ply(dir.read("reference.ply"));
}

void expect_equal(const TestMesh& mesh, const TestMesh& expected) {
  EXPECT_EQ(mesh.positions, expected.positions);
  EXPECT_EQ(mesh.normals, expected.normals);
  EXPECT_EQ(mesh.triangles, expected.triangles);
}

/// The corners of each triangle, in order: what parts have in common with the whole.
std::vector<Vec3f> soup(const TestMesh& mesh, bool normals) {
  std::vector<Vec3f> corners;
  for (const Triangle& t : mesh.triangles)
    for (const std::uint32_t v : t) corners.push_back((normals ? mesh.normals : mesh.positions)[v]);
  return corners;
}

void expect_same_triangles(const TestMesh& parts, const TestMesh& whole) {
  EXPECT_EQ(soup(parts, false), soup(whole, false));
  EXPECT_EQ(parts.normals.empty(), whole.normals.empty());
  if (!whole.normals.empty()) {
    EXPECT_EQ(soup(parts, true), soup(whole, true));
  }
  EXPECT_GE(parts.positions.size(), whole.positions.size());
}

TEST(MeshFormats, EachHasWhatPlyHas) {
  for (const bool normals : {false, true}) {
    const TempDir dir;
    const Chunks chunks = make_chunks(777);
    const TestMesh expected = as_ply(dir, chunks, normals);
    ASSERT_EQ(expected.triangles, chunks.mesh.triangles);
    ObjSink obj(dir / "a.obj", false);
    write(obj, chunks, normals);
    expect_equal(read_obj(dir.read("a.obj")), expected);
    VtpSink vtp(dir / "a.vtp", false);
    write(vtp, chunks, normals);
    expect_equal(read_vtp(dir.read("a.vtp")), expected);
    GlbSink glb(dir / "a.glb", false);
    write(glb, chunks, normals);
    const GlbFile file = read_glb(dir.read("a.glb"), dir / ".");
    EXPECT_EQ(file.parts, 1u);
    expect_equal(file.mesh, expected);
    PvtpSink pvtp(dir / "a.pvtp", false);
    write(pvtp, chunks, normals);
    const PvtpFile parts = read_pvtp(dir.read("a.pvtp"), dir / ".");
    EXPECT_EQ(parts.parts, 1u);
    expect_equal(parts.mesh, expected);
    EXPECT_EQ(dir.list(), (std::vector<std::string>{"a.glb", "a.obj", "a.pvtp", "a.pvtp.parts",
                                                    "a.vtp", "reference.ply"}));
  }
}

TEST(MeshFormats, TheUnitIsKept) {
  const TempDir dir;
  const Chunks chunks = make_chunks(777);
  const auto written = [&](const std::string& name, MeshSink&& sink) {
    write(sink, chunks, true, "micrometer");
    return dir.read(name);
  };
  const std::string ply = written("a.ply", PlySink(dir / "a.ply", false));
  EXPECT_TRUE(contains(ply.substr(0, 200), "\ncomment unit micrometer\n"));
  EXPECT_EQ(read_ply(ply).triangles, chunks.mesh.triangles);
  EXPECT_TRUE(written("a.obj", ObjSink(dir / "a.obj", false))
                  .starts_with("# Isobrick\n# unit micrometer\nv "));
  const std::string field =
      "<FieldData>\n      <Array type=\"String\" Name=\"unit\" NumberOfTuples=\"1\" "
      "format=\"ascii\">109 105 99 114 111 109 101 116 101 114 0</Array>";
  const std::string vtp = written("a.vtp", VtpSink(dir / "a.vtp", false));
  EXPECT_TRUE(contains(vtp, field));
  EXPECT_EQ(read_vtp(vtp).positions, chunks.mesh.positions);
  written("a.pvtp", PvtpSink(dir / "a.pvtp", false));
  EXPECT_TRUE(contains(dir.read("a.pvtp.parts/part_0.vtp"), field));
}

TEST(MeshFormats, AGlbIsInMetres) {
  for (const bool quantize : {false, true}) {
    const TempDir dir;
    const Chunks chunks = make_chunks(777);
    GlbSink plain(dir / "plain.glb", false, {.quantize = quantize}),
        sink(dir / "a.glb", false, {.quantize = quantize});
    write(plain, chunks, true);
    write(sink, chunks, true, "micrometer");
    const GlbFile expected = read_glb(dir.read("plain.glb"), dir / "."),
                  file = read_glb(dir.read("a.glb"), dir / ".");
    EXPECT_TRUE(contains(file.json, R"("extras":{"unit":"micrometer"})"));
    EXPECT_FALSE(contains(expected.json, "extras"));
    // Vertices stay as they are; the node scales their unit.
    EXPECT_NEAR(file.step, quantize ? 1e-6 * expected.step : 1e-6, 1e-15);
    ASSERT_EQ(file.mesh.positions.size(), chunks.mesh.positions.size());
    for (std::size_t i = 0; i < file.mesh.positions.size(); ++i)
      for (int axis = 0; axis < 3; ++axis) {
        const double here = double{expected.mesh.positions[i][axis]} * 1e-6;
        EXPECT_NEAR(file.mesh.positions[i][axis], here, std::abs(here) * 2e-7 + 1e-14);
      }
    EXPECT_EQ(dir.read("a.glb").substr(dir.read("a.glb").size() - 1000),
              dir.read("plain.glb").substr(dir.read("plain.glb").size() - 1000));
  }
}

TEST(MeshFormats, ChunksAndThreadsNeverShow) {
  const TempDir dir;
  const std::map<std::string, std::function<std::unique_ptr<MeshSink>(std::string, int)>> sinks{
      {"ply", [](auto path, int) { return std::make_unique<PlySink>(path, false); }},
      {"obj", [](auto path, int n) { return std::make_unique<ObjSink>(path, false, n); }},
      {"glb", [](auto path, int) { return std::make_unique<GlbSink>(path, false); }},
      {"vtp", [](auto path, int) { return std::make_unique<VtpSink>(path, false); }},
      {"pvtp", [](auto path, int n) { return std::make_unique<PvtpSink>(path, false, 1000, n); }}};
  for (const auto& [name, open] : sinks) {
    int n = 0;
    for (const Chunks& chunks : {make_chunks(100), make_chunks(3001), make_chunks(1 << 30),
                                 vertices_first(make_chunks(1))}) {
      fs::create_directory(dir / std::to_string(n));
      write(*open(dir / (std::to_string(n) + "/a." + name), n + 1), chunks, true);
      EXPECT_TRUE(dir.read("0/a." + name) == dir.read(std::to_string(n) + "/a." + name)) << name;
      ++n;
    }
    for (int i = 0; i < 4 && name == "pvtp"; ++i) {
      const std::string part = "/a.pvtp.parts/part_" + std::to_string(i) + ".vtp";
      EXPECT_TRUE(dir.read("0" + part) == dir.read("2" + part)) << part;
    }
    for (; n > 0; --n) fs::remove_all(dir / std::to_string(n - 1));
  }
}

TEST(MeshFormats, PartsOfPvtpMakeUpTheMesh) {
  for (const bool normals : {false, true}) {
    const TempDir dir;
    const Chunks chunks = make_chunks(500);
    PvtpSink sink(dir / "a.pvtp", false, 1000);
    write(sink, chunks, normals);
    const PvtpFile file = read_pvtp(dir.read("a.pvtp"), dir / ".");
    EXPECT_EQ(file.parts, (chunks.mesh.triangles.size() + 999) / 1000);
    expect_same_triangles(file.mesh, as_ply(dir, chunks, normals));
    EXPECT_LT(file.mesh.positions.size(), chunks.mesh.positions.size() * 5 / 4);
  }
}

TEST(MeshFormats, AGlbThatIsTooLargeIsCut) {
  for (const bool quantize : {false, true}) {
    const TempDir dir;
    const Chunks chunks = make_chunks(500);
    GlbSink whole(dir / "whole.glb", false, {.quantize = quantize});
    write(whole, chunks, true);
    const GlbFile expected = read_glb(dir.read("whole.glb"), dir / ".");
    GlbSink sink(dir / "a b%.glb", false,
                 {.quantize = quantize, .file_bytes = 100'000, .part_triangles = 1000});
    write(sink, chunks, true);
    const GlbFile file = read_glb(dir.read("a b%.glb"), dir / ".");
    EXPECT_EQ(file.parts, (chunks.mesh.triangles.size() + 999) / 1000);
    // One grid for all parts, or they would not meet.
    EXPECT_EQ(file.step, expected.step);
    expect_same_triangles(file.mesh, expected.mesh);
    EXPECT_LT(dir.read("a b%.glb").size(), 100'000u);
  }
}

TEST(MeshFormats, QuantizedIsWithinHalfAStep) {
  for (const bool normals : {false, true}) {
    const TempDir dir;
    const Chunks chunks = make_chunks(10'000);
    GlbSink sink(dir / "a.glb", false, {.quantize = true});
    write(sink, chunks, normals);
    const std::string bytes = dir.read("a.glb");
    const GlbFile file = read_glb(bytes, dir / ".");
    EXPECT_NEAR(file.step, 14.0 / 65535, 1e-6);  // the ball's diameter
    EXPECT_EQ(file.mesh.triangles, chunks.mesh.triangles);
    ASSERT_EQ(file.mesh.positions.size(), chunks.mesh.positions.size());
    for (std::size_t i = 0; i < chunks.mesh.positions.size(); ++i)
      for (int axis = 0; axis < 3; ++axis) {
        const float p = chunks.mesh.positions[i][axis];
        // The test's reader rounds to float.
        const double rounding = std::abs(double{p}) * 6e-8;
        EXPECT_NEAR(file.mesh.positions[i][axis], p, file.step / 2 * (1 + 1e-9) + rounding);
        if (normals) {
          EXPECT_NEAR(file.mesh.normals[i][axis], chunks.mesh.normals[i][axis], 1.6e-5);
        }
      }
    const std::size_t row = normals ? 16 : 8;
    EXPECT_NEAR(
        static_cast<double>(bytes.size()),
        static_cast<double>(chunks.mesh.positions.size() * row + chunks.mesh.triangles.size() * 12),
        2000);
  }
}

TEST(MeshFormats, AFlatMeshCanBeQuantized) {
  const TempDir dir;
  Chunks chunks;
  chunks.mesh.positions = {{5, 5, 5}, {5, 5, 5}, {5, 5, 5}};
  chunks.mesh.triangles = {{0, 1, 2}};
  chunks.ends = {{3, 1}};
  GlbSink sink(dir / "a.glb", false, {.quantize = true});
  write(sink, chunks, false);
  expect_equal(read_glb(dir.read("a.glb"), dir / ".").mesh, chunks.mesh);
}

TEST(MeshFormats, AnEmptyMeshIsAFile) {
  for (const bool normals : {false, true}) {
    const TempDir dir;
    const Chunks nothing;
    ObjSink obj(dir / "a.obj", false);
    write(obj, nothing, normals);
    EXPECT_EQ(dir.read("a.obj"), "# Isobrick\n");
    VtpSink vtp(dir / "a.vtp", false);
    write(vtp, nothing, normals);
    EXPECT_TRUE(read_vtp(dir.read("a.vtp")).positions.empty());
    GlbSink glb(dir / "a.glb", false, {.quantize = normals});
    write(glb, nothing, normals);
    EXPECT_EQ(read_glb(dir.read("a.glb"), dir / ".").parts, 0u);
    PvtpSink pvtp(dir / "a.pvtp", false);
    write(pvtp, nothing, normals);
    EXPECT_EQ(read_pvtp(dir.read("a.pvtp"), dir / ".").parts, 1u);
  }
}

TEST(MeshFormats, AFinishedSinkSaysHowLongTheMeshIs) {
  const TempDir dir;
  const Chunks chunks = make_chunks(700);
  const auto expect_length = [&](MeshSink& sink, const std::string& name) {
    write(sink, chunks, true);
    EXPECT_EQ(sink.bytes(), dir.read(name).size()) << name;
  };
  ObjSink obj(dir / "a.obj", false);
  expect_length(obj, "a.obj");
  VtpSink vtp(dir / "a.vtp", false);
  expect_length(vtp, "a.vtp");
  GlbSink glb(dir / "a.glb", false);
  expect_length(glb, "a.glb");
}

TEST(MeshFormats, ObjNumbersReadBackAsTheSameFloat) {
  const TempDir dir;
  Chunks chunks;
  for (const float v : {0.1f, -0.0f, 1e-38f, 3.4e38f, 1.f / 3, 16777217.f, 123456.789f})
    chunks.mesh.positions.push_back({v, -v, v * 0.5f});
  chunks.mesh.triangles = {{0, 1, 2}, {4, 5, 6}};
  chunks.ends = {{7, 2}};
  ObjSink sink(dir / "a.obj", false);
  write(sink, chunks, false);
  const TestMesh mesh = read_obj(dir.read("a.obj"));
  expect_equal(mesh, chunks.mesh);
  EXPECT_TRUE(std::signbit(mesh.positions[1].x));
  EXPECT_TRUE(contains(dir.read("a.obj"), "\nv 0.1 -0.1 0.05\n"));
}

TEST(VtpLayout, NumbersGrowOnlyWhereTheyMust) {
  constexpr std::uint64_t vertices = std::numeric_limits<std::int32_t>::max();
  const auto wide = [](MeshSize size) { return VtpLayout{size, true}.wide(); };
  EXPECT_FALSE(wide({vertices, 715827882}));
  EXPECT_TRUE(wide({vertices + 1, 1}));
  EXPECT_TRUE(wide({1, 715827883}));
  const VtpLayout large{{std::uint64_t{1} << 32, std::uint64_t{1} << 33}, true};
  EXPECT_EQ(large.header().size(), VtpLayout{}.header().size());
  EXPECT_TRUE(contains(large.header(), "type=\"Int64\" Name=\"offsets\""));
  EXPECT_EQ(large.connectivity_bytes(), (std::uint64_t{1} << 33) * 24);
  const VtpLayout largest{{~std::uint64_t{0} / 12, ~std::uint64_t{0} / 24}, true};
  EXPECT_EQ(largest.header().size(), VtpLayout{}.header().size());
  VtpLayout with_unit = largest;
  with_unit.unit = "femtometer";  // no name is longer
  EXPECT_EQ(with_unit.header().size(), VtpLayout{}.header().size());
  EXPECT_TRUE(contains(with_unit.header(), "</PolyData>"));
  with_unit.global_ids = true;
  EXPECT_TRUE(contains(with_unit.header(), "</PolyData>"));
}

TEST(VtpLayout, WideNumbersAreInt64) {
  const TempDir dir;
  const VtpLayout wide{{std::uint64_t{1} << 31, 2}, false};
  OutputFile out(dir / "a", false);
  const Triangle triangles[] = {{0, 1, 4294967294u}, {7, 8, 9}};
  append_connectivity(out.writer(), wide, triangles);
  append_vtp_end(out.writer(), wide);
  out.publish();
  const std::string bytes = dir.read("a");
  const std::int64_t expected[] = {0, 1, 4294967294, 7, 8, 9, 16, 3, 6};
  EXPECT_EQ(bytes.substr(0, sizeof(expected)),
            std::string(reinterpret_cast<const char*>(expected), sizeof(expected)));
}

}  // namespace
}  // namespace isobrick
