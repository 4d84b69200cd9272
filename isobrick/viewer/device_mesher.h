#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "isobrick/surface/grid_view.h"
#include "isobrick/viewer/node_mesh.h"

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

/// Makes meshes of grids on a device. Belongs to one thread.
class GridWorker {
 public:
  virtual ~GridWorker() = default;
  /// The mesh of GridExtractor, byte for byte: in out.device, or in out.mesh where memory is
  /// not shared or there is no room. Throws Error when the device fails.
  virtual void make(const GridView& grid, NodeMesh& out) = 0;
};

/// A device that makes meshes. Thread-safe.
class DeviceMesher {
 public:
  virtual ~DeviceMesher() = default;
  /// For the calling thread. Throws Error when the device fails.
  virtual std::unique_ptr<GridWorker> worker() = 0;
  virtual const std::string& name() const = 0;
  /// Whether meshes lie in memory that can be imported, and a block to try that with.
  virtual std::optional<DeviceBlock> shared_block() const = 0;
  /// From now on meshes go to host memory.
  virtual void share_nothing() = 0;
  /// Device memory taken for meshes.
  virtual std::uint64_t bytes() const = 0;
};

/// 16 bytes by which drivers tell devices apart.
using DeviceId = std::array<std::uint8_t, 16>;

/// Opens a CUDA device (some tenths of a second the first time): the one that draws, with memory
/// shared up to `budget` bytes, or else the first one, whose meshes go through host memory. Null
/// where there is none. Throws Error when it cannot be opened.
std::shared_ptr<DeviceMesher> open_device_mesher(const std::optional<DeviceId>& drawing,
                                                 std::uint64_t budget);

}  // namespace isobrick
