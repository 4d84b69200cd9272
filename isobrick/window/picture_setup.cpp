#include "isobrick/window/picture_setup.h"

#include <epoxy/gl.h>

#include <algorithm>
#include <utility>
#include <vector>

#include "isobrick/render/gl_context.h"

namespace isobrick {
namespace {

/// Room of a block of what is uploaded: little of the budget, so that little of it is idle. Meshes
/// that are larger have blocks of their own.
std::uint32_t block_vertices(std::uint64_t device_memory) {
  constexpr std::uint64_t vertex = 4 * sizeof(Vec3f);  // with a normal and two triangles
  return static_cast<std::uint32_t>(
      std::clamp<std::uint64_t>(device_memory / 128 / vertex, 1u << 12, 1u << 19));
}

/// A flat mesh of about as many triangles as vertices.
PooledMesh add_sheet(MeshPool& pool, std::uint32_t vertices) {
  const std::uint32_t row = vertices / 100;
  std::vector<Vec3f> positions(vertices), normals(vertices, {0, 0, 1});
  for (std::uint32_t i = 0; i < vertices; ++i)
    positions[i] = {static_cast<float>(i % row) / static_cast<float>(row),
                    static_cast<float>(i / row) / 100, 0};
  std::vector<Triangle> triangles;
  for (std::uint32_t i = 0; i + row < vertices; ++i) triangles.push_back({i, i + 1, i + row});
  MeshChunk mesh;
  mesh.positions = positions;
  mesh.normals = normals;
  mesh.triangles = triangles;
  return pool.add(mesh);
}

}  // namespace

PictureSetup::PictureSetup(const PictureBudgets& budgets, std::function<void()> on_change,
                           PictureSize likely, std::optional<bool> software)
    : pool_(block_vertices(budgets.device_memory)),
      software_(software.value_or(current_gl_device().software)),
      device_(std::make_shared<DeviceOpening>(budgets.device_mesh_memory(), std::move(on_change))) {
  // Software compiles quickly and draws slowly.
  if (!software_) prepare(likely, block_vertices(budgets.device_memory));
  // Only now: while CUDA is set up, whoever makes OpenGL ask for memory waits for it, tens of
  // milliseconds at a time.
  if (budgets.backend != Backend::cpu) device_->begin();
}

/// As a first store is drawn, some times over: that much it takes until a driver has all that it
/// wants.
void PictureSetup::prepare(PictureSize likely, std::uint32_t block_vertices) {
  PictureSettings full, plain;
  full.picking = plain.picking = true;          // as StorePicture's pictures
  plain.occlusion = plain.multisample = false;  // as while something moves
  for (const PictureSize size : {PictureSize{}, likely})
    for (const PictureSettings& settings : {full, plain})
      renderer_.prepare(settings, size.width, size.height);
  std::vector<PooledMesh> meshes(3);  // most of a block
  for (PooledMesh& mesh : meshes) mesh = add_sheet(pool_, block_vertices / 7 * 2);
  for (const PictureSettings& settings : {full, plain}) {
    renderer_.begin(Camera({0, 0, 1}, {0, 0, 0}, {0, 1, 0}), likely.width, likely.height, settings);
    for (const PooledMesh& mesh : meshes) renderer_.draw(mesh, {});
    renderer_.end();
  }
  renderer_.discard();
  glFinish();
}

}  // namespace isobrick
