#include "viewer/render/mesh_picture.h"

#include <algorithm>
#include <filesystem>
#include <optional>

#include <fmt/format.h>

#include <isobrick/error.h>
#include "core/box_union.h"
#include "core/length_unit.h"
#include "io/bytes/mapped_file.h"
#include "viewer/render/gl_context.h"

namespace isobrick::inline v0 {
namespace {

struct OpenMesh {
  std::string path;
  std::unique_ptr<MeshFile> file;
  MeshStyle style;
  double scale = 1;  ///< from the mesh's unit to the picture's
};

/// Chooses the picture's unit and sets each mesh's scale to it.
std::string choose_unit(std::vector<OpenMesh>& meshes) {
  std::string unit;
  for (OpenMesh& mesh : meshes) {
    const std::string own = mesh.file->info().unit;
    if (own.empty()) continue;
    if (unit.empty()) unit = own;
    mesh.scale = unit_ratio(own, unit).value_or(1);
  }
  return unit;
}

/// Draws the scale bar of a picture in `unit`, in the requested unit.
void draw_scale_bar(Renderer& renderer, const std::string& unit, const std::string& requested) {
  if (requested.empty()) return renderer.draw_scale_bar(unit_symbol(unit));
  renderer.draw_scale_bar(unit_symbol(requested), unit_ratio(requested, unit).value_or(1));
}

/// Scales the chunks of a mesh; coordinates are relative to an origin.
class ScaledChunk {
 public:
  explicit ScaledChunk(double scale) : scale_(static_cast<float>(scale)), scaled_(scale != 1) {}

  MeshChunk operator()(MeshChunk chunk) {
    if (!scaled_) return chunk;
    positions_.assign(chunk.positions.begin(), chunk.positions.end());
    for (Vec3f& p : positions_) p = p * scale_;
    chunk.positions = positions_;
    return chunk;
  }

 private:
  float scale_;
  bool scaled_;
  std::vector<Vec3f> positions_;
};

/// Bounds of all meshes that have a vertex; nullopt if none has.
std::optional<WorldBox> bounds_of(const std::vector<OpenMesh>& meshes) {
  BoxUnion<WorldBox> all;
  for (const OpenMesh& mesh : meshes) {
    if (mesh.file->info().vertices == 0) continue;
    WorldBox box;
    mesh.file->bounds(box.lo, box.hi);
    all.include({box.lo * mesh.scale, box.hi * mesh.scale});
  }
  return all.box();
}

/// Maximum bytes of a batch of triangles: with normals and colours, in vectors with up to twice the
/// capacity, and once more during the upload.
constexpr std::uint64_t kBatchBytes =
    MeshFile::kBatch * 3 * (sizeof(Triangle) / 3 + 2 * sizeof(Vec3f) + sizeof(VertexColour)) * 3;

/// Maximum resident bytes of mapped files, if triangles name vertices that are far apart.
std::uint64_t mapped_memory(const MeshPictureRequest& request) {
  std::uint64_t bytes = 0;
  for (const MeshInput& mesh : request.meshes) {
    std::error_code failure;
    const std::uintmax_t size = std::filesystem::file_size(mesh.path, failure);
    if (!failure) bytes += size;
  }
  // Text and compressed files are also decoded into a file of numbers, which may be larger.
  return std::min<std::uint64_t>(4 * bytes, 4 * MappedFile::kWindow);
}

}  // namespace

std::uint64_t mesh_picture_memory(const MeshPictureRequest& request) {
  const bool transparent = std::any_of(request.meshes.begin(), request.meshes.end(),
                                       [](const auto& mesh) { return mesh.style.opacity < 1; });
  const auto pixels =
      static_cast<std::uint64_t>(request.width) * static_cast<std::uint64_t>(request.height);
  return Renderer::driver_memory() +
         Renderer::memory(request.width, request.height, request.settings, transparent) +
         pixels * (4 + 3 + 4) + kBatchBytes + mapped_memory(request);
}

MeshPicture draw_mesh_files(const MeshPictureRequest& request, Progress& progress) {
  MeshPicture picture;
  std::vector<OpenMesh> meshes;
  std::uint64_t faces = 0;
  for (const MeshInput& mesh : request.meshes) {
    meshes.push_back({.path = mesh.path, .file = open_mesh_file(mesh.path), .style = mesh.style});
    const MeshFileInfo info = meshes.back().file->info();
    picture.vertices += info.vertices;
    faces += info.faces;
  }
  picture.unit = choose_unit(meshes);
  if (picture.unit.empty() && !request.scale_bar_unit.empty())
    throw UsageError(fmt::format(
        "'{}' has no unit, so that a scale bar cannot be in {}; without a unit it counts in the "
        "mesh's own",
        meshes.front().path, request.scale_bar_unit));
  // Transparent meshes come last.
  std::stable_sort(meshes.begin(), meshes.end(), [](const OpenMesh& a, const OpenMesh& b) {
    return a.style.opacity >= 1 && b.style.opacity < 1;
  });
  if (const auto bounds = bounds_of(meshes)) {
    picture.lo = bounds->lo;
    picture.hi = bounds->hi;
  }

  GlContext context;
  Renderer renderer;
  picture.renderer = current_gl_device().renderer;
  const double aspect = static_cast<double>(request.width) / request.height;
  renderer.begin(make_camera(request.camera, picture.lo, picture.hi, aspect), request.width,
                 request.height, request.settings);
  const Vec3d origin = (picture.lo + picture.hi) * 0.5;
  progress.begin("draw", faces * sizeof(Triangle));
  for (const OpenMesh& mesh : meshes) {
    const std::uint64_t before = picture.triangles;
    ScaledChunk scaled(mesh.scale);
    mesh.file->read(origin * (1 / mesh.scale), [&](const MeshChunk& chunk, Vec3d from) {
      renderer.draw(scaled(chunk), mesh.style, from * mesh.scale);
      picture.triangles += chunk.triangles.size();
      progress.advance(chunk.triangles.size_bytes());
    });
    if (picture.triangles == before)
      throw Error(fmt::format("'{}' has no triangles to draw; is it whole?", mesh.path));
  }
  progress.end();
  if (request.box) renderer.draw_box(picture.lo, picture.hi, {0.36f, 0.40f, 0.46f});
  if (request.axes) renderer.draw_axes();
  if (request.scale_bar) draw_scale_bar(renderer, picture.unit, request.scale_bar_unit);
  renderer.end();
  picture.rgba = renderer.read_pixels();
  return picture;
}

}  // namespace isobrick
