#include "isobrick/render/mesh_file.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <functional>

#include "isobrick/meshes/glb_sink.h"
#include "isobrick/meshes/obj_sink.h"
#include "isobrick/meshes/ply_sink.h"
#include "isobrick/meshes/stl_sink.h"
#include "isobrick/render/gl_context.h"
#include "isobrick/render/mesh_picture.h"
#include "tests/io/base64_text.h"
#include "tests/io/temp_dir.h"
#include "tests/meshes/test_meshes.h"

namespace isobrick {
namespace {

constexpr std::uint32_t kRings = 20;

void write(MeshSink& sink, bool normals = true, const std::string& unit = "") {
  const TestMesh ball = make_ball({1, 2, 3}, 1, kRings);
  sink.begin({normals, {0, 1, 2}, {2, 3, 4}, {}, unit});
  sink.write(ball.chunk(0, normals));
  sink.finish();
}

/// All corners of all triangles in the world, in the file's order.
std::vector<Vec3d> corners_of(const std::string& path, Vec3d origin = {1, 2, 3}) {
  std::vector<Vec3d> corners;
  open_mesh_file(path)->read(origin, [&](const MeshChunk& chunk, Vec3d from) {
    for (const Triangle& t : chunk.triangles)
      for (const std::uint32_t i : t) {
        const Vec3f p = chunk.positions[i];
        corners.push_back(Vec3d{p.x, p.y, p.z} + from);
      }
  });
  return corners;
}

void expect_ball(const std::string& path, bool normals, double tolerance) {
  const TestMesh ball = make_ball({1, 2, 3}, 1, kRings);
  const std::unique_ptr<MeshFile> file = open_mesh_file(path);
  EXPECT_EQ(file->info().faces, ball.triangles.size()) << path;
  file->read({1, 2, 3}, [&](const MeshChunk& chunk, Vec3d) {
    ASSERT_EQ(chunk.normals.size(), normals ? chunk.positions.size() : 0) << path;
    for (std::size_t i = 0; i < chunk.normals.size(); ++i) {
      const Vec3f p = chunk.positions[i], n = chunk.normals[i];
      EXPECT_NEAR(dot(p, n), std::sqrt(dot(p, p) * dot(n, n)), 1e-4) << path;
    }
  });
  Vec3d lo, hi;
  file->bounds(lo, hi);
  EXPECT_NEAR(lo.z, 2, 1e-4);
  EXPECT_NEAR(hi.z, 4, 1e-4);
  const std::vector<Vec3d> corners = corners_of(path);
  ASSERT_EQ(corners.size(), 3 * ball.triangles.size()) << path;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const Vec3f p = ball.positions[ball.triangles[i / 3][i % 3]];
    EXPECT_NEAR(corners[i].x, p.x, tolerance) << path;
    EXPECT_NEAR(corners[i].y, p.y, tolerance) << path;
    EXPECT_NEAR(corners[i].z, p.z, tolerance) << path;
  }
}

/// Everything that reading takes: opening, bounds, triangles.
void read_all(const std::string& path) {
  const std::unique_ptr<MeshFile> file = open_mesh_file(path);
  Vec3d lo, hi;
  file->bounds(lo, hi);
  file->read(lo, [](const MeshChunk&, Vec3d) {});
}

TEST(MeshFile, ReadsWhatTheSinksWrite) {
  const TempDir dir;
  {
    PlySink ply(dir / "a.ply", false), plain(dir / "plain.ply", false);
    write(ply);
    write(plain, false);
    GlbSink glb(dir / "a.glb", false), small(dir / "q.glb", false, GlbOptions{.quantize = true});
    write(glb);
    write(small);
    ObjSink obj(dir / "a.obj", false, 1);
    write(obj);
  }
  expect_ball(dir / "a.ply", true, 1e-6);
  expect_ball(dir / "plain.ply", false, 1e-6);
  expect_ball(dir / "a.glb", true, 1e-6);
  expect_ball(dir / "q.glb", true, 2.1 / 65535);
  expect_ball(dir / "a.obj", true, 1e-6);
}

TEST(MeshFile, HasTheUnitOfTheStore) {
  const TempDir dir;
  const auto unit_of = [&](const std::string& name, MeshSink&& sink, const std::string& unit) {
    write(sink, true, unit);
    return open_mesh_file(dir / name)->info().unit;
  };
  for (const std::string unit : {"", "micrometer", "inch", "meter"}) {
    EXPECT_EQ(unit_of("a.ply", PlySink(dir / "a.ply", true), unit), unit);
    EXPECT_EQ(unit_of("a.obj", ObjSink(dir / "a.obj", true, 1), unit), unit);
    EXPECT_EQ(unit_of("a.glb", GlbSink(dir / "a.glb", true), unit), unit);
    EXPECT_EQ(unit_of("q.glb", GlbSink(dir / "q.glb", true, {.quantize = true}), unit), unit);
    EXPECT_EQ(unit_of("a.stl", StlSink(dir / "a.stl", true), unit), "");
    // In that unit, whatever the file measures in.
    expect_ball(dir / "a.ply", true, 1e-6);
    expect_ball(dir / "a.obj", true, 1e-6);
    expect_ball(dir / "a.glb", true, 1e-6);
    expect_ball(dir / "q.glb", true, 2.1 / 65535);
  }
  EXPECT_EQ(open_mesh_file(dir.write("b.obj", "# unit banana\nv 0 0 0\n"))->info().unit, "");
  EXPECT_EQ(open_mesh_file(dir.write("c.obj", "# unit: none\n#unit mm\r\n"))->info().unit, "");
  EXPECT_EQ(open_mesh_file(dir.write("d.obj", "# unit mm\r\nv 0 0 0\r\n"))->info().unit,
            "millimeter");
}

TEST(MeshFile, ReadsStl) {
  const TempDir dir;
  const TestMesh ball = make_ball({1, 2, 3}, 1, kRings);
  StlSink stl(dir / "a.stl", false);
  write(stl);
  EXPECT_EQ(open_mesh_file(dir / "a.stl")->info().faces, ball.triangles.size());
  EXPECT_EQ(corners_of(dir / "a.stl").size(), 3 * ball.triangles.size());
}

TEST(MeshFile, ReadsTextPly) {
  const TempDir dir;
  const std::string path =
      dir.write("a.ply",
                "ply\r\nformat ascii 1.0\r\ncomment unit mm\r\n"
                "element camera 1\nproperty float f\nproperty list uchar int l\n"
                "element vertex 4\nproperty uchar mark\nproperty double x\n"
                "property double y\nproperty double z\nproperty float nx\n"
                "property float ny\nproperty float nz\nelement face 2\n"
                "property list uchar int vertex_indices\nproperty int n\n"
                "end_header\n1.5 2 7 8\n"
                "9 5000000.123456 0 7 0 0 1\n9 1 0 7 0 0 1\n"
                "9 0 1 7\n0 0 1 9 1 1 7 0 0 1\n"  // rows need no lines
                "4 0 1 3 2 -1\n3 0 1\n2 -1\n");
  const std::unique_ptr<MeshFile> file = open_mesh_file(path);
  EXPECT_EQ(file->info().vertices, 4U);
  EXPECT_EQ(file->info().faces, 2U);
  EXPECT_EQ(file->info().unit, "millimeter");
  for (int again = 0; again < 2; ++again) {
    const std::vector<Vec3d> corners = corners_of(path, {5e6, 0, 0});
    ASSERT_EQ(corners.size(), 9U);  // a fan of two, and one
    EXPECT_NEAR(corners[0].x, 5000000.123456, 1e-7);
    EXPECT_EQ(corners[2], (Vec3d{1, 1, 7}));
    EXPECT_EQ(corners[8], (Vec3d{0, 1, 7}));
  }
  file->read({}, [](const MeshChunk& chunk, Vec3d) {
    ASSERT_EQ(chunk.normals.size(), chunk.positions.size());
    EXPECT_EQ(chunk.normals[0], (Vec3f{0, 0, 1}));
  });
}

TEST(MeshFile, ReadsTextStl) {
  const TempDir dir;
  const std::string facet =
      "  facet normal nan -nan(ind) 0\n    outer loop\n      vertex 5000000.123456 0 1e0\n"
      "      VERTEX 1 0 +1\n      vertex 0 1 1\n    endloop\n  endfacet\n";
  const std::string path =
      dir.write("a.stl", "solid two words\r\n" + facet + facet + "endsolid two words\nsolid\n" +
                             facet + "endsolid");
  EXPECT_EQ(open_mesh_file(path)->info().faces, 3U);
  const std::vector<Vec3d> corners = corners_of(path, {5e6, 0, 0});
  ASSERT_EQ(corners.size(), 9U);
  EXPECT_NEAR(corners[6].x, 5000000.123456, 1e-7);
  EXPECT_EQ(corners[7], (Vec3d{1, 0, 1}));
  Vec3d lo, hi;
  open_mesh_file(path)->bounds(lo, hi);
  EXPECT_EQ(lo, (Vec3d{0, 0, 1}));
  // A binary file may begin with the same word.
  StlSink stl(dir / "b.stl", false);
  write(stl);
  std::string bytes = dir.read("b.stl").replace(0, 5, "solid");
  EXPECT_EQ(open_mesh_file(dir.write("b.stl", bytes))->info().faces,
            make_ball({1, 2, 3}, 1, kRings).triangles.size());
}

TEST(MeshFile, TextSaysTheLineThatIsWrong) {
  const TempDir dir;
  const std::string head =
      "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
      "property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n";
  const std::vector<std::array<std::string, 3>> files{
      {"a.ply", head + "0 0 0\n1 x 0\n0 1 0\n3 0 1 2\n", "line 11: 'x' is no number"},
      {"b.ply", head + "0 0 0\n1 0 0\n0 1 0\n3 0 1\n", "line 13: it ends within an element 'face'"},
      {"c.ply", head + "0 0 0\n1 0\n", "line 11: it ends within an element 'vertex'"},
      {"d.ply", head + "0 0 0\n1 0 0\n0 1 0\n1.5 0 1 2\n", "line 13: a list has 1.5 items"},
      {"e.ply", head + "0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n", "names vertex 3 of 3"},
      {"a.stl", "solid a\nfacet normal 0 0 1\nouter loop\nvertex 1 2\nvertex 1 2 3\n",
       "line 5: 'vertex' is no number"},
      {"b.stl", "solid a\nfacet normal 0 0 1\nouter loop\n", "line 3: it ends where 'vertex'"},
      {"c.stl", "solid a\nfacets\n", "line 2: 'facets' stands where 'facet'"},
      {"d.stl", "solid a\n", "line 1: it ends where 'facet'"},
  };
  for (const auto& [name, text, expected] : files) {
    const std::string path = dir.write(name, text);
    const std::string message = message_of<Error>([&] { read_all(path); });
    EXPECT_TRUE(contains(message, name) && contains(message, expected)) << message;
  }
}

TEST(MeshFile, BigEndianPlyWithOtherProperties) {
  const TempDir dir;
  std::string text =
      "ply\nformat binary_big_endian 1.0\nelement vertex 4\nproperty uchar mark\nproperty double "
      "x\n"
      "property double y\nproperty double z\nelement face 1\nproperty list uchar int "
      "vertex_indices\nproperty uchar mark\nend_header\n";
  const auto add = [&](auto value) {
    char bytes[sizeof(value)];
    std::memcpy(bytes, &value, sizeof(value));
    for (std::size_t i = sizeof(value); i-- > 0;) text += bytes[i];
  };
  for (int i = 0; i < 4; ++i) {
    text += 'm';
    add(static_cast<double>(i & 1));
    add(static_cast<double>(i / 2));
    add(7.0);
  }
  text += '\x04';
  for (const int i : {0, 1, 3, 2}) add(i);
  text += 'm';
  const std::vector<Vec3d> corners = corners_of(dir.write("a.ply", text));
  ASSERT_EQ(corners.size(), 6u);  // a fan
  EXPECT_EQ(corners[2], (Vec3d{1, 1, 7}));
  EXPECT_EQ(corners[5], (Vec3d{0, 1, 7}));
}

TEST(MeshFile, DamageIsSaid) {
  const TempDir dir;
  const std::string head = "ply\nformat binary_little_endian 1.0\n";
  const std::string xyz = "property float x\nproperty float y\nproperty float z\n";
  const std::string list = "property list uchar uint vertex_indices\nend_header\n";
  const std::string zeros(36, '\0');
  const std::vector<std::pair<std::string, std::string>> files{
      {"no_end.ply", head + "element vertex 3\n" + xyz},
      {"text.ply", "ply\nformat ascii 1.0\nend_header\n"},
      {"many.ply",
       head + "element vertex 18446744073709551615\n" + xyz + "element face 1\n" + list},
      {"faces.ply", head + "element vertex 3\n" + xyz + "element face 4000000000\n" + list + zeros},
      {"index.ply", head + "element vertex 3\n" + xyz + "element face 1\n" + list + zeros +
                        std::string("\x03\x00\x00\x00\x00\x01\x00\x00\x00\x09\x00\x00\x00", 13)},
      {"long.ply", head + "element vertex 3\n" + xyz + "element face 1\n" + list + zeros +
                       std::string("\xff\x00\x00\x00\x00", 5)},
      {"nan.ply", head + "element vertex 3\n" + xyz + "element face 0\n" + list +
                      std::string("\x00\x00\xc0\x7f", 4) + std::string(32, '\0')},
      {"none.ply", head + "element vertex 1\nproperty float x\nend_header\n" + zeros},
      {"short.stl", std::string(20, 'a')},
      {"count.stl", std::string(80, 'a') + std::string("\xff\xff\xff\xff", 4)},
      {"text.stl", "solid a\nfacet normal 0 0 1\n" + std::string(100, ' ')},
      {"number.obj", "v 1 2 x\n"},
      {"index.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n"},
      {"back.obj", "v 0 0 0\nf -1 -2 -3\n"},
      {"zero.obj", "v 0 0 0\nf 0 1 1\n"},
      {"corners.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 1 2"},
      {"short.glb", "glTF"},
      {"empty.ply", ""},
      {"empty.glb", ""},
      {"empty.stl", ""},
  };
  for (const auto& [name, bytes] : files) {
    const std::string path = dir.write(name, bytes);
    const std::string message = message_of<Error>([&] { read_all(path); });
    EXPECT_TRUE(contains(message, name)) << message;
  }
  message_of([&] { open_mesh_file(dir.write("a.txt", "hello")); });
}

TEST(MeshFile, HalfOfOneIsSaid) {
  const TempDir dir;
  PlySink ply(dir / "a.ply", false);
  write(ply);
  GlbSink glb(dir / "a.glb", false);
  write(glb);
  StlSink stl(dir / "a.stl", false);
  write(stl);
  for (const char* name : {"a.ply", "a.glb", "a.stl"}) {
    const auto size = std::filesystem::file_size(dir / name);
    for (const std::uintmax_t left : {size - 1, size - 40, size / 2, size / 9, size / 90}) {
      std::filesystem::resize_file(dir / name, left);
      SCOPED_TRACE(left);
      EXPECT_TRUE(contains(message_of<Error>([&] { read_all(dir / name); }), name));
    }
  }
}

TEST(MeshFile, WithoutTrianglesIsNoPicture) {
  if (!GlContext::available()) GTEST_SKIP() << "no OpenGL 4.5 without a window here";
  const TempDir dir;
  dir.write("empty.obj", "");
  dir.write("vertices.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\n");
  dir.write("whole.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  const TestMesh none;
  const auto write_none = [&](MeshSink&& sink) {
    sink.begin({false, {0, 0, 0}, {0, 0, 0}});
    sink.write(none.chunk());
    sink.finish();
  };
  write_none(PlySink(dir / "none.ply", false));
  write_none(StlSink(dir / "none.stl", false));
  write_none(GlbSink(dir / "none.glb", false));
  for (const char* name : {"empty.obj", "vertices.obj", "none.ply", "none.stl", "none.glb"}) {
    MeshPictureRequest request{.width = 32, .height = 32};
    for (const char* mesh : {"whole.obj", name}) request.meshes.push_back({dir / mesh, {}});
    NoProgress progress;
    EXPECT_TRUE(contains(message_of<Error>([&] { draw_mesh_files(request, progress); }), name));
  }
}

std::string glb(const std::string& json, std::string binary) {
  std::string scene = json;
  scene.resize((scene.size() + 3) / 4 * 4, ' ');
  std::string bytes = "glTF";
  const auto add = [&](std::uint32_t word) {
    bytes.append(reinterpret_cast<const char*>(&word), sizeof(word));
  };
  add(2);
  add(static_cast<std::uint32_t>(28 + scene.size() + binary.size()));
  add(static_cast<std::uint32_t>(scene.size()));
  bytes += "JSON" + scene;
  add(static_cast<std::uint32_t>(binary.size()));
  return bytes + std::string("BIN\0", 4) + binary;
}

TEST(MeshFile, NormalsStayAcrossTheSurfaceWhereAxesAreScaledDifferently) {
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

TEST(MeshFile, AGlbOfOthersIsInMetres) {
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

/// A triangle in a picture from above.
MeshPictureRequest request_of(const std::vector<std::string>& paths) {
  MeshPictureRequest request{.width = 64, .height = 64};
  for (const std::string& path : paths) request.meshes.push_back({path, {}});
  request.scale_bar = true;
  return request;
}

TEST(MeshFile, UnitsOfSeveralMeshesBecomeThatOfTheFirst) {
  if (!GlContext::available()) GTEST_SKIP() << "no OpenGL 4.5 without a window here";
  const TempDir dir;
  const auto obj = [&](const std::string& name, const std::string& unit, const std::string& size) {
    return dir.write(name, (unit.empty() ? "" : "# unit " + unit + "\n") + "v 0 0 0\nv " + size +
                               " 0 0\nv 0 " + size + " 0\nf 1 2 3\n");
  };
  const std::string none = obj("none.obj", "", "3"), mm = obj("mm.obj", "millimeter", "2"),
                    um = obj("um.obj", "micrometer", "5000");
  NoProgress progress;
  const MeshPicture in_mm = draw_mesh_files(request_of({none, mm, um}), progress),
                    in_um = draw_mesh_files(request_of({um, mm}), progress),
                    without = draw_mesh_files(request_of({none}), progress);
  EXPECT_EQ(in_mm.unit, "millimeter");
  EXPECT_EQ(in_mm.hi, (Vec3d{5, 5, 0}));
  EXPECT_EQ(in_um.unit, "micrometer");
  EXPECT_EQ(in_um.hi, (Vec3d{5000, 5000, 0}));
  EXPECT_EQ(without.unit, "");
  MeshPictureRequest request = request_of({none});
  request.scale_bar_unit = "millimeter";
  const std::string message = message_of<UsageError>([&] { draw_mesh_files(request, progress); });
  EXPECT_TRUE(contains(message, "none.obj") && contains(message, "has no unit")) << message;
}

TEST(MeshFile, AScaleBarIsTheSameLengthInAnyUnit) {
  if (!GlContext::available()) GTEST_SKIP() << "no OpenGL 4.5 without a window here";
  const TempDir dir;
  // The same triangle twice: what the bar says must not depend on what the file measures in.
  const std::string mm = dir.write("mm.obj", "# unit mm\nv 0 0 0\nv 2 0 0\nv 0 2 0\nf 1 2 3\n"),
                    um = dir.write("um.obj",
                                   "# unit um\nv 0 0 0\nv 2000 0 0\nv 0 2000 0\nf 1 2 3\n");
  const auto pixels = [&](const std::string& path, const std::string& unit) {
    MeshPictureRequest request = request_of({path});
    request.width = request.height = 256;
    request.scale_bar_unit = unit;
    NoProgress progress;
    return draw_mesh_files(request, progress).rgba;
  };
  EXPECT_TRUE(pixels(mm, "") == pixels(um, "millimeter"));
  EXPECT_TRUE(pixels(um, "") == pixels(mm, "micrometer"));
  EXPECT_FALSE(pixels(um, "") == pixels(mm, ""));
}

/// A GLB's scene as a .gltf whose buffer is at `uri`.
std::string scene_of(const std::string& glb_bytes, const std::string& uri) {
  std::uint32_t size = 0;
  std::memcpy(&size, glb_bytes.data() + 12, sizeof(size));
  std::string scene = glb_bytes.substr(20, size);
  const std::string buffers = R"("buffers":[{)";
  return scene.insert(scene.find(buffers) + buffers.size(), R"("uri":")" + uri + R"(",)");
}

TEST(MeshFile, ReadsScenesInText) {
  const TempDir dir;
  GlbSink sink(dir / "a.glb", false);
  write(sink, true, "micrometer");
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

/// The colours of the corners of all triangles.
std::vector<VertexColour> colours_of(const std::string& path) {
  std::vector<VertexColour> colours;
  open_mesh_file(path)->read({}, [&](const MeshChunk& chunk, Vec3d) {
    ASSERT_TRUE(chunk.colours.empty() || chunk.colours.size() == chunk.positions.size());
    if (chunk.colours.empty()) return;
    for (const Triangle& t : chunk.triangles)
      for (const std::uint32_t v : t) colours.push_back(chunk.colours[v]);
  });
  return colours;
}

/// A triangle of a red, a green and a half blue corner.
const std::vector<VertexColour> kColours{{255, 0, 0, 255}, {0, 255, 0, 255}, {0, 0, 128, 255}};

std::string coloured_ply(const std::string& kind, const std::string& full,
                         const std::string& half) {
  std::string colours;
  for (const char* name : {"red", "green", "blue"})
    colours += "property " + kind + " " + name + "\n";
  return "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
         "property float z\n" +
         colours + "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0 " +
         full + " 0 0\n1 0 0 0 " + full + " 0\n0 1 0 0 0 " + half + "\n3 0 1 2\n";
}

TEST(MeshFile, ReadsColoursOfVertices) {
  const TempDir dir;
  EXPECT_EQ(colours_of(dir.write("a.ply", coloured_ply("uchar", "255", "128"))), kColours);
  EXPECT_EQ(colours_of(dir.write("b.ply", coloured_ply("ushort", "65535", "32896"))), kColours);
  EXPECT_EQ(colours_of(dir.write("c.ply", coloured_ply("float", "1", "0.502"))), kColours);
  std::string binary =
      "ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\n"
      "property float y\nproperty float z\nproperty uchar red\nproperty uchar green\n"
      "property uchar blue\nelement face 1\nproperty list uchar uint vertex_indices\n"
      "end_header\n";
  for (const VertexColour& colour : kColours) {
    binary.append(12, '\0');
    binary.append(reinterpret_cast<const char*>(colour.data()), 3);
  }
  binary += std::string("\x03\0\0\0\0\x01\0\0\0\x02\0\0\0", 13);
  EXPECT_EQ(colours_of(dir.write("d.ply", binary)), kColours);
  EXPECT_EQ(
      colours_of(dir.write("a.obj", "v 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 0 1 0 0 0 0.502\nf 1 2 3\n")),
      kColours);
  // A weight behind a position is no colour, nor is one of some vertices only.
  for (const char* text :
       {"v 0 0 0 1\nv 1 0 0 1\nv 0 1 0 1\nf 1 2 3\n", "v 0 0 0 1 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"})
    EXPECT_TRUE(colours_of(dir.write("b.obj", text)).empty());
}

TEST(MeshFile, ReadsColoursOfScenes) {
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

/// How many pixels are mostly red, green and blue.
std::array<int, 3> pixels_by_colour(const MeshPicture& picture) {
  std::array<int, 3> count{};
  for (std::size_t i = 0; i < picture.rgba.size(); i += 4)
    for (std::size_t c = 0; c < 3; ++c)
      count[c] += picture.rgba[i + c] > 90 + picture.rgba[i + (c + 1) % 3] &&
                  picture.rgba[i + c] > 90 + picture.rgba[i + (c + 2) % 3];
  return count;
}

TEST(MeshFile, ColoursOfVerticesAreDrawn) {
  if (!GlContext::available()) GTEST_SKIP() << "no OpenGL 4.5 without a window here";
  const TempDir dir;
  const std::string path = dir.write("a.ply", coloured_ply("uchar", "255", "255"));
  NoProgress progress;
  for (const float opacity : {1.0f, 0.8f})
    for (const bool cut : {false, true}) {
      MeshPictureRequest request{.width = 64, .height = 64};
      request.camera.elevation = 80;
      request.meshes = {{path, {.opacity = opacity}}};
      if (cut) request.settings.planes = {{{0, 0, 1}, -1}};  // nothing of it goes
      for (const int count : pixels_by_colour(draw_mesh_files(request, progress)))
        EXPECT_GT(count, 15) << opacity << cut;
      // A colour that is asked for goes before.
      request.meshes[0].style.vertex_colours = false;
      request.meshes[0].style.colour = {1, 0, 0};
      const std::array<int, 3> one = pixels_by_colour(draw_mesh_files(request, progress));
      EXPECT_GT(one[0], 200);
      EXPECT_EQ(one[1] + one[2], 0);
    }
}

TEST(MeshFile, DamagedScenesAreSaid) {
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

TEST(MeshFile, CoordinatesFarFromZeroKeepTheirDecimals) {
  const TempDir dir;
  const std::string obj =
      "v 5000000.123456 -5000000.5 0.25\nv 5000000.223456 -5000000.5 0.25\n"
      "v 5000000.123456 -5000000.375 0.25\nf 1 2 3\n";
  const std::string ply =
      "ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty double x\n"
      "property double y\nproperty double z\nelement face 1\n"
      "property list uchar uint vertex_indices\nend_header\n";
  const std::vector<Vec3d> expected{{5000000.123456, -5000000.5, 0.25},
                                    {5000000.223456, -5000000.5, 0.25},
                                    {5000000.123456, -5000000.375, 0.25}};
  std::string body(reinterpret_cast<const char*>(expected.data()), 3 * sizeof(Vec3d));
  const std::array<std::uint32_t, 3> face{0, 1, 2};
  body += '\3';
  body.append(reinterpret_cast<const char*>(face.data()), sizeof(face));
  for (const std::string& path : {dir.write("far.obj", obj), dir.write("far.ply", ply + body)}) {
    const std::vector<Vec3d> corners = corners_of(path, {5e6, -5e6, 0});
    ASSERT_EQ(corners.size(), expected.size()) << path;
    for (std::size_t i = 0; i < corners.size(); ++i)
      for (const int axis : {0, 1, 2})
        EXPECT_NEAR(corners[i][axis], expected[i][axis], 1e-7) << path;
  }
}

TEST(MeshFile, ScenesNestedTooDeeplyAreRefused) {
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
