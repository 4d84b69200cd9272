#include "viewer/app/picture_setup.h"

#include <epoxy/gl.h>

#include <algorithm>
#include <array>
#include <utility>
#include <vector>

#include <isobrick/error.h>
#include "pipeline/extract/gpu_backend.h"
#include "viewer/render/gl_context.h"

namespace isobrick::inline v0 {
namespace {

/// A size that suffices to compile all shaders.
constexpr PictureSize kCompileSize{16, 16};

/// Whether CUDA's initialisation may delay OpenGL, which waits if both use one driver.
bool cuda_may_delay_gl(Backend backend) {
  return backend != Backend::cpu && built_with_cuda() && current_gl_device().nvidia;
}

/// Settings of still frames and of previews.
std::array<PictureSettings, 2> usual_settings() {
  PictureSettings full, plain;
  full.picking = plain.picking = true;  // as in SceneRenderer
  plain.occlusion = plain.multisample = false;
  return {full, plain};
}

/// Capacity of a block of the upload pool: a small part of the budget, so that little of it is
/// unused. Larger meshes have blocks of their own.
std::uint32_t block_vertices(std::uint64_t device_memory) {
  constexpr std::uint64_t vertex = 4 * sizeof(Vec3f);  // with a normal and two triangles
  return static_cast<std::uint32_t>(
      std::clamp<std::uint64_t>(device_memory / 128 / vertex, 1u << 12, 1u << 19));
}

/// Adds a flat mesh with about as many triangles as vertices.
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
                           std::optional<PictureSize> likely, std::optional<bool> software)
    : block_vertices_(block_vertices(budgets.device_memory)),
      pool_(block_vertices_),
      software_(software.value_or(current_gl_device().software)),
      device_(std::make_shared<DeviceOpener>(budgets.device_mesh_memory(), std::move(on_change))) {
  // A software driver compiles fast and draws slowly.
  if (!software_)
    for (const PictureSettings& settings : usual_settings())
      renderer_.prepare(settings, kCompileSize.width, kCompileSize.height);
  if (likely && !software_ && cuda_may_delay_gl(budgets.backend)) warm_up(*likely);
  // Comes last: while CUDA is initialised, an OpenGL call that allocates memory waits for tens of
  // milliseconds.
  if (budgets.backend != Backend::cpu) device_->begin();
}

void PictureSetup::warm_up(PictureSize size) {
  try {
    draw_first(size);
  } catch (const Error&) {  // a later picture reports the error
  }
  renderer_.discard();
  glFinish();
}

/// Draws like a first store, several times: only then has a driver allocated all that it needs.
void PictureSetup::draw_first(PictureSize size) {
  for (const PictureSettings& settings : usual_settings())
    renderer_.prepare(settings, size.width, size.height);
  std::vector<PooledMesh> meshes(3);  // most of a block
  for (PooledMesh& mesh : meshes) mesh = add_sheet(pool_, block_vertices_ / 7 * 2);
  for (const PictureSettings& settings : usual_settings()) {
    renderer_.begin(Camera({0, 0, 1}, {0, 0, 0}, {0, 1, 0}), size.width, size.height, settings);
    for (const PooledMesh& mesh : meshes) renderer_.draw(mesh, {});
    renderer_.end();
  }
}

}  // namespace isobrick
