#include "viewer/render/mesh_picture.h"

#include <gtest/gtest.h>

#include <array>
#include <string>
#include <vector>

#include "io/meshes/glb_sink.h"
#include "io/meshes/ply_sink.h"
#include "io/meshes/stl_sink.h"
#include "tests/io/bytes/temp_dir.h"
#include "tests/io/meshes/mesh_files.h"
#include "viewer/render/gl_context.h"

namespace isobrick::inline v0 {
namespace {

/// A picture of a triangle from above.
MeshPictureRequest request_of(const std::vector<std::string>& paths) {
  MeshPictureRequest request{.width = 64, .height = 64};
  for (const std::string& path : paths) request.meshes.push_back({path, {}});
  request.scale_bar = true;
  return request;
}

/// Numbers of pixels that are mostly red, green and blue.
std::array<int, 3> pixels_by_colour(const MeshPicture& picture) {
  std::array<int, 3> count{};
  for (std::size_t i = 0; i < picture.rgba.size(); i += 4)
    for (std::size_t c = 0; c < 3; ++c)
      count[c] += picture.rgba[i + c] > 90 + picture.rgba[i + (c + 1) % 3] &&
                  picture.rgba[i + c] > 90 + picture.rgba[i + (c + 2) % 3];
  return count;
}

TEST(MeshPictures, WithoutTrianglesIsNoPicture) {
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

TEST(MeshPictures, UnitsOfSeveralMeshesBecomeThatOfTheFirst) {
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

TEST(MeshPictures, AScaleBarIsTheSameLengthInAnyUnit) {
  if (!GlContext::available()) GTEST_SKIP() << "no OpenGL 4.5 without a window here";
  const TempDir dir;
  // The same triangle in two units: the bar's text must not depend on the file's unit.
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

TEST(MeshPictures, ColoursOfVerticesAreDrawn) {
  if (!GlContext::available()) GTEST_SKIP() << "no OpenGL 4.5 without a window here";
  const TempDir dir;
  const std::string path = dir.write("a.ply", coloured_ply("uchar", "255", "255"));
  NoProgress progress;
  for (const float opacity : {1.0f, 0.8f})
    for (const bool cut : {false, true}) {
      MeshPictureRequest request{.width = 64, .height = 64};
      request.camera.elevation = 80;
      request.meshes = {{path, {.opacity = opacity}}};
      if (cut) request.settings.planes = {{{0, 0, 1}, -1}};  // clips nothing
      for (const int count : pixels_by_colour(draw_mesh_files(request, progress)))
        EXPECT_GT(count, 15) << opacity << cut;
      // A requested colour overrides the vertex colours.
      request.meshes[0].style.vertex_colours = false;
      request.meshes[0].style.colour = {1, 0, 0};
      const std::array<int, 3> one = pixels_by_colour(draw_mesh_files(request, progress));
      EXPECT_GT(one[0], 200);
      EXPECT_EQ(one[1] + one[2], 0);
    }
}

}  // namespace
}  // namespace isobrick
