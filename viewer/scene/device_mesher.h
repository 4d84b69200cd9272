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

// Node meshes made on a device, and their places in memory that OpenGL draws from:
// cuda_mesher.cpp where the CUDA backend is built, else no_cuda_mesher.cpp.

namespace isobrick {

/// A piece of device memory that many meshes lie in: positions, as many normals, triangles, one
/// array behind the other. Whoever draws imports it by its file descriptor.
struct DeviceBlock {
  int file = -1;  ///< open for as long as the block is there
  std::uint64_t bytes = 0;
  std::uint32_t vertices = 0, triangles = 0;  ///< room
  std::shared_ptr<const void> owner;          ///< keeps it; also tells blocks apart
};

/// A mesh in a block. Its place is given to others when this is destroyed: not before
/// what draws it has ended.
class DeviceMesh {
 public:
  virtual ~DeviceMesh() = default;
  DeviceBlock block;
  std::uint32_t first_vertex = 0, vertices = 0;
  std::uint32_t first_triangle = 0, triangles = 0;
};

/// A device that makes meshes of grids, several at a time, with a thread of its own. Thread-safe.
/// Whoever holds one keeps it; meshes that are being made when nobody does are still made.
class DeviceMesher {
 public:
  virtual ~DeviceMesher() = default;

  /// Gets the mesh that was asked for, or why there is none: the device failed, and makes no more.
  /// Called once for each grid, by the device's thread. Must not throw.
  using Callback = std::function<void(NodeMesh&& mesh, const std::string& failure)>;

  /// Has the mesh of GridExtractor made, byte for byte: in mesh.device, or in mesh.mesh where
  /// memory is not shared or there is no room. `mesh` says which it is. The grid is not
  /// looked at any more afterwards; waits only while as many as there is room for are being
  /// made. False when the device has failed: nothing was taken.
  virtual bool make(const GridView& grid, NodeMesh mesh, Callback done) = 0;
  /// Why the device makes no more; empty while it does.
  virtual std::string failure() const = 0;

  virtual const std::string& name() const = 0;
  /// The memory that meshes lie in, to be imported; nothing: meshes go to host memory. Always the
  /// same, but for share_only().
  virtual std::vector<DeviceBlock> shared_blocks() const = 0;
  /// Gives all but the first so many of these back. Before the first mesh.
  virtual void share_only(std::size_t blocks) = 0;
  /// Device memory of those blocks, whatever lies in them.
  virtual std::uint64_t bytes() const = 0;
  /// Held while the device makes meshes. A device switches slowly between compute and drawing, so
  /// the thread that draws with it takes this lock as well.
  virtual TicketLock& kernel_lock() = 0;

  /// What the device's thread has done so far.
  struct Times {
    std::uint64_t launches = 0, grids = 0;
    double lock = 0;    ///< seconds of waiting for its turn
    double memory = 0;  ///< of finding places for meshes
    double device = 0;  ///< until the device was done
    double deliver = 0;
  };
  virtual Times times() const = 0;
};

/// 16 bytes by which drivers tell devices apart.
using DeviceId = std::array<std::uint8_t, 16>;

/// Opens a CUDA device (some tenths of a second the first time): the one that draws, with `budget`
/// bytes of memory that is shared, or else the first one, whose meshes go through host memory. Null
/// where there is none. Throws Error when it cannot be opened.
std::shared_ptr<DeviceMesher> open_device_mesher(const std::optional<DeviceId>& drawing,
                                                 std::uint64_t budget);

}  // namespace isobrick
