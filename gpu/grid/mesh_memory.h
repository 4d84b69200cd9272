#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "core/mesh_free_list.h"
#include "gpu/grid/grid_batch.h"

namespace isobrick::inline v0::gpu {

/// A large block of device memory that other interfaces (OpenGL) can import: an array of
/// positions, one of as many normals, one of twice as many triangles.
struct SharedMeshBlock {
  int file = -1;                              ///< descriptor to import it by; closed with the block
  std::uint64_t bytes = 0;                    ///< all arrays, one behind the other without gaps
  std::uint32_t vertices = 0, triangles = 0;  ///< room
};

class OwnedMeshBlock;

/// The room of a mesh in a block. It is free again once this is destroyed: nothing may read or
/// write it any more then.
class MeshSlice {
 public:
  MeshSlice(std::shared_ptr<OwnedMeshBlock> block, const MeshRange& range)
      : block_(std::move(block)), range_(range) {}
  MeshSlice(MeshSlice&& other) noexcept = default;
  MeshSlice& operator=(MeshSlice&& other) noexcept {
    std::swap(block_, other.block_);
    std::swap(range_, other.range_);
    return *this;
  }
  ~MeshSlice();

  std::shared_ptr<const SharedMeshBlock> block() const;
  const MeshRange& range() const { return range_; }
  GridMeshPlace place() const;
  /// Frees what is behind the first so many.
  void trim(std::uint32_t vertices, std::uint32_t triangles);

 private:
  std::shared_ptr<OwnedMeshBlock> block_;
  MeshRange range_;
};

/// Device memory for many meshes, in blocks that stay until the end. Thread-safe.
class MeshMemory {
 public:
  /// Takes all blocks at once, so that others can import them beforehand: as many as `budget` bytes
  /// hold, fewer where the device's memory is short. Throws Error for less than a block, and where
  /// not even one can be had or exported.
  MeshMemory(int device, std::uint64_t budget);
  ~MeshMemory();

  /// Room for a mesh; nothing where there is none.
  std::optional<MeshSlice> take(std::uint32_t vertices, std::uint32_t triangles);

  /// Gives all but the first so many blocks back. Before any of them is used.
  void keep(std::size_t count);

  std::vector<std::shared_ptr<const SharedMeshBlock>> blocks() const;
  /// Of blocks.
  std::uint64_t bytes() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace isobrick::gpu
