#include "viewer/render/imported_buffers.h"

#include <epoxy/gl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include <isobrick/error.h>

namespace isobrick::inline v0 {

static_assert(GL_UUID_SIZE_EXT == 16);

std::optional<std::array<std::uint8_t, 16>> current_gl_device_id() {
  if (!epoxy_has_gl_extension("GL_EXT_memory_object_fd")) return std::nullopt;
  GLint count = 0;
  glGetIntegerv(GL_NUM_DEVICE_UUIDS_EXT, &count);
  if (count < 1) return std::nullopt;
  std::array<std::uint8_t, 16> id{};
  glGetUnsignedBytei_vEXT(GL_DEVICE_UUID_EXT, 0, id.data());
  check_gl("asking for the device");
  return id;
}

ImportedBuffers::ImportedBuffers(int file, std::uint64_t bytes, std::uint32_t vertices,
                                 std::uint32_t triangles) {
  const int own = dup(file);  // OpenGL takes ownership of the descriptor
  if (own < 0)
    throw Error(fmt::format("OpenGL: memory of another interface: {}", std::strerror(errno)));
  glCreateMemoryObjectsEXT(1, &memory_);
  glImportMemoryFdEXT(memory_, bytes, GL_HANDLE_TYPE_OPAQUE_FD_EXT, own);
  std::uint64_t offset = 0;
  const auto buffer = [&](std::uint64_t size) {
    unsigned name = 0;
    glCreateBuffers(1, &name);
    glNamedBufferStorageMemEXT(name, static_cast<GLsizeiptr>(size), memory_, offset);
    offset += size;
    return GlBuffer(name);
  };
  positions_ = buffer(vertices * sizeof(Vec3f));
  normals_ = buffer(vertices * sizeof(Vec3f));
  triangles_ = buffer(triangles * sizeof(Triangle));
  try {
    check_gl("memory of another interface");
  } catch (...) {
    glDeleteMemoryObjectsEXT(1, &memory_);
    throw;
  }
}

ImportedBuffers::~ImportedBuffers() { glDeleteMemoryObjectsEXT(1, &memory_); }

MeshPlace ImportedBuffers::place(std::uint32_t first_vertex, std::uint32_t vertices,
                                 std::uint32_t first_triangle, std::uint32_t triangles) const {
  return {positions_.get(), normals_.get(), triangles_.get(), first_vertex,
          vertices,         first_triangle, triangles};
}

}  // namespace isobrick
