#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/ticket_lock.h"
#include "surface/grid_view.h"
#include "viewer/scene/node_mesh.h"

// Node meshes made by a device, in memory that OpenGL can draw from. cuda_mesher.cpp implements it
// where the CUDA backend is built, else no_cuda_mesher.cpp.

namespace isobrick::inline v0 {

/// A block of device memory that many meshes share: an array of positions, one of as many normals,
/// one of triangles, in this order. OpenGL imports it by its file descriptor.
struct DeviceBlock {
  int file = -1;  ///< descriptor; open while the block lives
  std::uint64_t bytes = 0;
  std::uint32_t vertices = 0, triangles = 0;  ///< capacity
  std::shared_ptr<const void> owner;          ///< keeps the block; identifies it
};

/// A mesh in a block. Destroying it frees its space for other meshes, so the pictures that draw it
/// must have finished.
class DeviceMesh {
 public:
  virtual ~DeviceMesh() = default;
  DeviceBlock block;
  std::uint32_t first_vertex = 0, vertices = 0;
  std::uint32_t first_triangle = 0, triangles = 0;
};

/// A device that makes meshes of grids, several in one launch, with a thread of its own. It still
/// makes the meshes in flight after its last owner has released it. Thread-safe.
class DeviceMesher {
 public:
  virtual ~DeviceMesher() = default;

  /// Receives the mesh, or the reason for which the device failed and makes no more meshes. The
  /// device's thread calls it once for each grid. It must not throw.
  using Callback = std::function<void(NodeMesh&& mesh, const std::string& failure)>;

  /// Requests a mesh, the same bytes as from GridExtractor. It arrives in mesh.device, or in
  /// mesh.mesh where memory is not shared or the shared memory is full. `mesh` names which node it
  /// is. The grid is copied before the call returns; the call waits while all slots are in use.
  /// Returns false if the device has failed: then `done` is not called.
  virtual bool make(const GridView& grid, NodeMesh mesh, Callback done) = 0;
  /// Why the device failed; empty while it works.
  virtual std::string failure() const = 0;

  virtual const std::string& name() const = 0;
  /// The blocks that OpenGL may import; empty if meshes go to host memory. Only share_only()
  /// changes them.
  virtual std::vector<DeviceBlock> shared_blocks() const = 0;
  /// Frees all shared blocks but the first `blocks`. Call it before the first mesh.
  virtual void share_only(std::size_t blocks) = 0;
  /// Bytes of all shared blocks, used or not.
  virtual std::uint64_t bytes() const = 0;
  /// The device holds it while it makes meshes. A device switches slowly between compute and
  /// graphics, so the thread that draws takes this lock as well.
  virtual TicketLock& kernel_lock() = 0;

  /// Totals of the device's thread. Times in seconds.
  struct Times {
    std::uint64_t launches = 0, grids = 0;
    double lock = 0;    ///< waiting for kernel_lock()
    double memory = 0;  ///< reserving space for meshes
    double device = 0;  ///< until the device finished
    double deliver = 0;
  };
  virtual Times times() const = 0;
};

/// The UUID of a device, the same in CUDA and OpenGL.
using DeviceId = std::array<std::uint8_t, 16>;

/// Opens the CUDA device with the id `drawing`, with `budget` bytes of memory shared with OpenGL.
/// If there is none, opens the first device, whose meshes go through host memory. The first call
/// takes some tenths of a second. Returns null where there is no device. Throws Error if it cannot
/// be opened.
std::shared_ptr<DeviceMesher> open_device_mesher(const std::optional<DeviceId>& drawing,
                                                 std::uint64_t budget);

}  // namespace isobrick
