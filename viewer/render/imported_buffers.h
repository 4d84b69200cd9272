#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "viewer/render/gl_objects.h"
#include "viewer/render/mesh_pool.h"

namespace isobrick {

/// By which drivers of all kinds tell devices apart: that of the current context; nothing
/// where OpenGL cannot import memory.
std::optional<std::array<std::uint8_t, 16>> current_gl_device_id();

/// Buffers for meshes in memory that another interface of the same device owns (CUDA): an array of
/// positions, one of as many normals, one of triangles, one behind the other. What is
/// written there by work that has ended before a drawing call is what the call draws.
class ImportedBuffers {
 public:
  /// `file`: descriptor of `bytes` bytes of exported memory; stays the caller's. Throws Error
  /// when it cannot be imported.
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
