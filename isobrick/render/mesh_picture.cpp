#include "isobrick/render/mesh_picture.h"

#include <algorithm>
#include <utility>

#include <fmt/format.h>

#include "isobrick/core/error.h"
#include "isobrick/render/gl_context.h"

namespace isobrick {
namespace {

struct Opened {
  std::string path;
  std::unique_ptr<MeshFile> file;
  MeshStyle style;
};

/// Bounds of all meshes that have a vertex; two equal corners if none has.
void find_bounds(const std::vector<Opened>& meshes, Vec3d& lo, Vec3d& hi) {
  bool any = false;
  for (const Opened& mesh : meshes) {
    if (mesh.file->info().vertices == 0) continue;
    Vec3d mesh_lo, mesh_hi;
    mesh.file->bounds(mesh_lo, mesh_hi);
    if (!std::exchange(any, true)) {
      lo = mesh_lo;
      hi = mesh_hi;
    }
    for (int axis = 0; axis < 3; ++axis) {
      lo[axis] = std::min(lo[axis], mesh_lo[axis]);
      hi[axis] = std::max(hi[axis], mesh_hi[axis]);
    }
  }
}

}  // namespace

MeshPicture draw_mesh_files(const MeshPictureRequest& request, Progress& progress) {
  MeshPicture picture;
  std::vector<Opened> meshes;
  std::uint64_t faces = 0;
  for (const PicturedMesh& mesh : request.meshes) {
    meshes.push_back({mesh.path, open_mesh_file(mesh.path), mesh.style});
    const MeshFileInfo info = meshes.back().file->info();
    picture.vertices += info.vertices;
    faces += info.faces;
  }
  // Those that are seen through come last.
  std::stable_sort(meshes.begin(), meshes.end(), [](const Opened& a, const Opened& b) {
    return a.style.opacity >= 1 && b.style.opacity < 1;
  });
  find_bounds(meshes, picture.lo, picture.hi);

  GlContext context;
  Renderer renderer;
  picture.renderer = current_gl_device().renderer;
  const double aspect = static_cast<double>(request.width) / request.height;
  renderer.begin(make_camera(request.camera, picture.lo, picture.hi, aspect), request.width,
                 request.height, request.settings);
  const Vec3d origin = (picture.lo + picture.hi) * 0.5;
  progress.begin("draw", faces * sizeof(Triangle));
  for (const Opened& mesh : meshes) {
    const std::uint64_t before = picture.triangles;
    mesh.file->read(origin, [&](const MeshChunk& chunk, Vec3d from) {
      renderer.draw(chunk, mesh.style, from);
      picture.triangles += chunk.triangles.size();
      progress.advance(chunk.triangles.size_bytes());
    });
    if (picture.triangles == before)
      throw Error(fmt::format("'{}' has no triangles to draw; is it whole?", mesh.path));
  }
  progress.end();
  if (request.box) renderer.draw_box(picture.lo, picture.hi, {0.36f, 0.40f, 0.46f});
  if (request.axes) renderer.draw_axes();
  if (request.scale_bar) renderer.draw_scale_bar(request.unit);
  renderer.end();
  picture.rgba = renderer.read_pixels();
  return picture;
}

}  // namespace isobrick
