#include "io/meshes/readers/mesh_file.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <functional>

#include "io/meshes/glb_sink.h"
#include "io/meshes/obj_sink.h"
#include "io/meshes/ply_sink.h"
#include "io/meshes/stl_sink.h"
#include "tests/io/bytes/temp_dir.h"
#include "tests/io/meshes/mesh_files.h"

namespace isobrick::inline v0 {
namespace {

TEST(MeshFile, ReadsWhatTheSinksWrite) {
  const TempDir dir;
  {
    PlySink ply(dir / "a.ply", false), plain(dir / "plain.ply", false);
    write_ball(ply);
    write_ball(plain, false);
    GlbSink glb(dir / "a.glb", false), small(dir / "q.glb", false, GlbOptions{.quantize = true});
    write_ball(glb);
    write_ball(small);
    ObjSink obj(dir / "a.obj", false, 1);
    write_ball(obj);
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
    write_ball(sink, true, unit);
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
  write_ball(stl);
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
  write_ball(stl);
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
  write_ball(ply);
  GlbSink glb(dir / "a.glb", false);
  write_ball(glb);
  StlSink stl(dir / "a.stl", false);
  write_ball(stl);
  for (const char* name : {"a.ply", "a.glb", "a.stl"}) {
    const auto size = std::filesystem::file_size(dir / name);
    for (const std::uintmax_t left : {size - 1, size - 40, size / 2, size / 9, size / 90}) {
      std::filesystem::resize_file(dir / name, left);
      SCOPED_TRACE(left);
      EXPECT_TRUE(contains(message_of<Error>([&] { read_all(dir / name); }), name));
    }
  }
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

}  // namespace
}  // namespace isobrick
