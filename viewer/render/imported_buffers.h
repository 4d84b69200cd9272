#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "viewer/render/gl_objects.h"
#include "viewer/render/mesh_pool.h"

namespace isobrick::inline v0 {

/// The UUID of the current context's device, which CUDA reports too; nullopt if OpenGL cannot
/// import memory.
std::optional<std::array<std::uint8_t, 16>> current_gl_device_id();

/// OpenGL buffers in memory of another interface of the same device (CUDA): an array of positions,
/// one of as many normals, one of triangles, in this order. A draw call sees the data of writes
/// that finished before it.
class ImportedBuffers {
 public:
  /// `file`: descriptor of `bytes` bytes of exported memory; the caller keeps it. Throws Error if
  /// the import fails.
  ImportedBuffers(int file, std::uint64_t bytes, std::uint32_t vertices, std::uint32_t triangles);
  ~ImportedBuffers();
  ImportedBuffers(const ImportedBuffers&) = delete;
  ImportedBuffers& operator=(const ImportedBuffers&) = delete;

  MeshPlace place(std::uint32_t first_vertex, std::uint32_t vertices, std::uint32_t first_triangle,
                  std::uint32_t triangles) const;

 private:
  unsigned memory_ = 0;
  GlBuffer positions_, normals_, triangles_;
};

}  // namespace isobrick
