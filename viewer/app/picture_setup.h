#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>

#include <isobrick/extract.h>
#include "viewer/app/device_meshes.h"
#include "viewer/render/mesh_pool.h"
#include "viewer/render/renderer.h"

namespace isobrick::inline v0 {

/// Budgets and options for pictures of a store.
struct PictureBudgets {
  std::uint64_t memory = std::uint64_t{2} << 30;  ///< host memory for resident bricks and meshes
  std::uint64_t device_memory = std::uint64_t{1} << 30;  ///< device memory for meshes and slices
  int threads = 0;                                       ///< 0: all cores but one
  Backend backend = Backend::automatic;                  ///< makes meshes; see DeviceMeshes
  std::optional<Inside> inside;                          ///< see StreamOptions

  /// The part of device_memory for meshes that the device makes. Slices and uploads have the rest,
  /// or all if no device shares its memory.
  std::uint64_t device_mesh_memory() const { return device_memory / 4 * 3; }
};

/// In pixels.
struct PictureSize {
  int width = 1, height = 1;
};

/// The resources of a context that take time to set up: compiled shaders, memory, and the device
/// that makes meshes. Made once for a context, so that stores open quickly; one scene renderer
/// after the other uses it. For the thread of the context, which must outlive it.
class PictureSetup {
 public:
  /// Starts to open the device for budgets.backend and does not wait for it; see DeviceOpener.
  /// `likely`: size of the first pictures; if CUDA would delay them, warm_up() runs first.
  /// `software`: whether OpenGL counts as software; nullopt: detected. Throws what Renderer and
  /// DeviceOpener::begin() throw.
  PictureSetup(const PictureBudgets& budgets, std::function<void()> on_change,
               std::optional<PictureSize> likely = std::nullopt,
               std::optional<bool> software = std::nullopt);

  /// Draws pictures of this size and a first block of meshes, so that the driver allocates what
  /// they need. Does nothing if memory is short.
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
