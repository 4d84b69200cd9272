#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <utility>

namespace isobrick::inline v0 {

// Owners of OpenGL objects. Make and destroy them in a current context. Moved-from owners hold 0,
// which OpenGL ignores.

/// Owns an object's name; `Delete` deletes the object.
template <void (*Delete)(unsigned)>
class GlName {
 public:
  GlName() = default;
  explicit GlName(unsigned name) : name_(name) {}
  GlName(GlName&& other) noexcept : name_(std::exchange(other.name_, 0)) {}
  GlName& operator=(GlName&& other) noexcept {
    std::swap(name_, other.name_);
    return *this;
  }
  ~GlName() {
    if (name_ != 0) Delete(name_);
  }

  unsigned get() const { return name_; }
  explicit operator bool() const { return name_ != 0; }

 private:
  unsigned name_ = 0;
};

namespace gl {
void delete_buffer(unsigned name);
void delete_vertex_array(unsigned name);
void delete_texture(unsigned name);
void delete_framebuffer(unsigned name);
void delete_program(unsigned name);
}  // namespace gl

using GlBuffer = GlName<&gl::delete_buffer>;
using GlVertexArray = GlName<&gl::delete_vertex_array>;
using GlTexture = GlName<&gl::delete_texture>;
using GlFramebuffer = GlName<&gl::delete_framebuffer>;
using GlProgram = GlName<&gl::delete_program>;

/// Makes a buffer of `bytes` bytes that OpenGL, CUDA or a mapping may write. `what`: for messages.
GlBuffer make_buffer(std::uint64_t bytes, const char* what);
/// Makes a buffer whose content is replaced often; see fill_buffer().
GlBuffer make_stream_buffer();
/// Replaces the content and the size of a stream buffer.
void fill_buffer(const GlBuffer& buffer, std::span<const std::byte> bytes);

GlVertexArray make_vertex_array();

/// Makes a 2D texture without mipmaps and filtering; multisampled if `samples` > 1.
GlTexture make_texture(unsigned format, int width, int height, int samples, const char* what);

/// Makes a framebuffer of colour attachments 0, 1, … and a depth attachment (0: none).
GlFramebuffer make_framebuffer(std::span<const unsigned> colours, unsigned depth, const char* what);

/// Compiles and links a program; the sources have no #version line. Throws Error with the
/// compiler's message.
GlProgram make_program(const std::string& vertex, const std::string& fragment, const char* what);

/// A fence in the current context's command stream.
class GlFence {
 public:
  static GlFence insert();
  GlFence(GlFence&& other) noexcept : sync_(std::exchange(other.sync_, nullptr)) {}
  GlFence& operator=(GlFence&& other) noexcept {
    std::swap(sync_, other.sync_);
    return *this;
  }
  ~GlFence();

  /// Waits until all commands before it have finished.
  void wait() const;

 private:
  explicit GlFence(void* sync) : sync_(sync) {}
  void* sync_;
};

/// Throws Error "OpenGL: WHAT: …" if a call since the last check failed.
void check_gl(const char* what);

}  // namespace isobrick
