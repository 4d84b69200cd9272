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

/// A triangle, and as many without extent as a block has room for.
PooledMesh fill_block(MeshPool& pool, std::uint32_t vertices) {
  std::vector<Vec3f> places(vertices);
  places[1].x = places[2].y = 1;
  std::vector<Triangle> triangles(std::size_t{2} * vertices);
  triangles[0] = {0, 1, 2};
  MeshChunk mesh;
  mesh.positions = mesh.normals = places;
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

void PictureSetup::prepare(PictureSize likely, std::uint32_t block_vertices) {
  const PooledMesh mesh = fill_block(pool_, block_vertices);
  PictureSettings settings;
  settings.picking = true;  // as StorePicture's pictures
  renderer_.prepare(settings, likely.width, likely.height, mesh);
  settings.occlusion = settings.multisample = false;  // as while something moves
  renderer_.prepare(settings, likely.width, likely.height, mesh);
  glFinish();
}

}  // namespace isobrick
