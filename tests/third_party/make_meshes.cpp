// Writes meshes in every format, for readers of others to compare: one file
// name a mesh, one extension a format. Cases that no small volume brings about.

#include <filesystem>
#include <limits>

#include "io/meshes/glb_sink.h"
#include "io/meshes/obj_sink.h"
#include "io/meshes/ply_sink.h"
#include "io/meshes/vtp_sink.h"
#include "tests/io/meshes/test_meshes.h"

namespace isobrick::inline v0 {
namespace {

void write(MeshSink&& sink, const TestMesh& mesh, bool normals, const std::string& unit = "") {
  sink.begin({.has_normals = normals, .unit = unit});
  if (!mesh.positions.empty()) sink.write(mesh.chunk(0, normals));
  sink.finish();
}

void write_all(const std::filesystem::path& base, const TestMesh& mesh, bool normals) {
  constexpr std::uint64_t part = 1000, cut = 100'000;
  const auto name = [&](const char* extension) { return base.string() + extension; };
  const std::string unit = "micrometer";
  write(PlySink(name(".ply"), true), mesh, normals, unit);
  write(ObjSink(name(".obj"), true), mesh, normals, unit);
  write(VtpSink(name(".vtp"), true), mesh, normals, unit);
  write(PvtpSink(name(".pvtp"), true, part), mesh, normals, unit);
  write(GlbSink(name(".glb"), true), mesh, normals);
  write(GlbSink(name(".quantized.glb"), true, {.quantize = true}), mesh, normals);
#ifdef ISOBRICK_WITH_MESHOPT
  for (const bool quantize : {false, true})
    write(GlbSink(name(quantize ? ".quantized.compressed.glb" : ".compressed.glb"), true,
                  {.quantize = quantize, .compress = true, .part_triangles = 2500}),
          mesh, normals);
  write(GlbSink(name(".compressed.cut.glb"), true,
                {.compress = true, .file_bytes = 10'000, .part_triangles = part}),
        mesh, normals);
#endif
  for (const bool quantize : {false, true})
    write(GlbSink(name(quantize ? ".quantized.cut.glb" : ".cut.glb"), true,
                  {.quantize = quantize, .file_bytes = cut, .part_triangles = part}),
          mesh, normals);
}

void write_cases(const std::filesystem::path& folder) {
  const TestMesh ball = make_ball({1000.125f, -2, 3e-3f}, 7, 40);
  write_all(folder / "ball", ball, false);
  write_all(folder / "ball with 100% normals & <more>", ball, true);
  write_all(folder / "empty", {}, false);
  write_all(folder / "empty_normals", {}, true);
  TestMesh flat;
  flat.positions = {{1, 5, 7}, {2, 5, 7}, {3, 5, 7}};
  flat.normals = {{0, 0, 1}, {0, 1, 0}, {-0.6f, 0, 0.8f}};
  flat.triangles = {{0, 1, 2}};
  write_all(folder / "line", flat, true);
}

}  // namespace
}  // namespace isobrick

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  isobrick::write_cases(argv[1]);
}
