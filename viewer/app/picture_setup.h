#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>

#include <isobrick/extract.h>
#include "viewer/app/device_meshes.h"
#include "viewer/render/mesh_pool.h"
#include "viewer/render/renderer.h"

namespace isobrick {

/// What a picture of a store may use, and how its surfaces are made.
struct PictureBudgets {
  std::uint64_t memory = std::uint64_t{2} << 30;         ///< host: decoded bricks and meshes
  std::uint64_t device_memory = std::uint64_t{1} << 30;  ///< meshes and slices on the device
  int threads = 0;                                       ///< 0: all cores but one
  Backend backend = Backend::automatic;                  ///< what makes meshes; see DeviceMeshes
  std::optional<Inside> inside;                          ///< see StreamOptions

  /// Of device_memory: the part for meshes that the device makes itself. Slices and what is
  /// uploaded have the rest, and all where no device shares its memory.
  std::uint64_t device_mesh_memory() const { return device_memory / 4 * 3; }
};

/// Pixels.
struct PictureSize {
  int width = 1, height = 1;
};

/// What pictures of stores need of a context and what takes time to set up: compiled shaders,
/// memory, and a device that makes meshes. Made with the context, so that stores open quickly; one
/// picture after the other uses it. For the thread of the context, which must outlive it.
class PictureSetup {
 public:
  /// Begins to open the device that budgets.backend may use, and does not wait for it; see
  /// DeviceOpener. `likely`: of the first pictures, for warm_up() where they would wait for CUDA.
  /// `software`: whether to take OpenGL for software; nothing: what it is. Throws what Renderer and
  /// DeviceOpener::begin() do.
  PictureSetup(const PictureBudgets& budgets, std::function<void()> on_change,
               std::optional<PictureSize> likely = std::nullopt,
               std::optional<bool> software = std::nullopt);

  /// Gets what a driver needs for pictures of this size and a first block of meshes, so that they
  /// do not wait for that. Where memory is short it is left to them.
  void warm_up(PictureSize size);

  Renderer& renderer() { return renderer_; }
  /// For meshes that are uploaded.
  MeshPool& pool() { return pool_; }
  const std::shared_ptr<DeviceOpener>& device() const { return device_; }
  /// Whether OpenGL is software.
  bool software() const { return software_; }

 private:
  void draw_first(PictureSize size);

  Renderer renderer_;
  std::uint32_t block_vertices_;
  MeshPool pool_;
  bool software_;
  std::shared_ptr<DeviceOpener> device_;
};

}  // namespace isobrick
