#include "viewer/render/gl_objects.h"

#include <epoxy/gl.h>
#include <fmt/format.h>

#include <limits>

#include <vector>

#include <isobrick/error.h>

namespace isobrick::inline v0 {
namespace {

const char* name_of(unsigned error) {
  switch (error) {
    case GL_INVALID_ENUM: return "invalid enumeration value";
    case GL_INVALID_VALUE: return "invalid value";
    case GL_INVALID_OPERATION: return "invalid operation";
    case GL_INVALID_FRAMEBUFFER_OPERATION: return "incomplete framebuffer";
    case GL_OUT_OF_MEMORY: return "out of memory";
    case GL_CONTEXT_LOST: return "the device was lost";
    default: return "unknown error";
  }
}

/// Owns a shader or program until it is complete.
class Shader {
 public:
  Shader(unsigned kind, const std::string& source, const char* what) : name_(glCreateShader(kind)) {
    const std::string whole = "#version 450 core\n" + source;
    const char* text = whole.c_str();
    glShaderSource(name_, 1, &text, nullptr);
    glCompileShader(name_);
    int good = 0;
    glGetShaderiv(name_, GL_COMPILE_STATUS, &good);
    if (good) return;
    int length = 0;
    glGetShaderiv(name_, GL_INFO_LOG_LENGTH, &length);
    std::string log(static_cast<std::size_t>(length), '\0');
    glGetShaderInfoLog(name_, length, nullptr, log.data());
    glDeleteShader(name_);
    throw Error(fmt::format("OpenGL cannot compile the shader of {}: {}", what, log.c_str()));
  }
  ~Shader() { glDeleteShader(name_); }
  Shader(const Shader&) = delete;
  Shader& operator=(const Shader&) = delete;

  unsigned get() const { return name_; }

 private:
  unsigned name_;
};

}  // namespace

namespace gl {
void delete_buffer(unsigned name) { glDeleteBuffers(1, &name); }
void delete_vertex_array(unsigned name) { glDeleteVertexArrays(1, &name); }
void delete_texture(unsigned name) { glDeleteTextures(1, &name); }
void delete_framebuffer(unsigned name) { glDeleteFramebuffers(1, &name); }
void delete_program(unsigned name) { glDeleteProgram(name); }
}  // namespace gl

GlFence GlFence::insert() {
  GlFence fence(glFenceSync(GL_SYNC_GPU_COMMANDS_COMPLETE, 0));
  glFlush();
  return fence;
}

GlFence::~GlFence() { glDeleteSync(static_cast<GLsync>(sync_)); }

void GlFence::wait() const {
  glClientWaitSync(static_cast<GLsync>(sync_), 0, std::numeric_limits<GLuint64>::max());
}

void check_gl(const char* what) {
  const unsigned error = glGetError();
  if (error == GL_NO_ERROR) return;
  // One call may set several flags; the first one suffices. A lost context would return errors for
  // ever.
  for (int i = 0; i < 16 && glGetError() != GL_NO_ERROR; ++i) {
  }
  throw Error(fmt::format("OpenGL: {}: {}", what, name_of(error)));
}

GlBuffer make_buffer(std::uint64_t bytes, const char* what) {
  unsigned name = 0;
  glCreateBuffers(1, &name);
  GlBuffer buffer(name);
  glNamedBufferStorage(name, static_cast<GLsizeiptr>(bytes), nullptr,
                       GL_DYNAMIC_STORAGE_BIT | GL_MAP_WRITE_BIT);
  check_gl(what);
  return buffer;
}

GlBuffer make_stream_buffer() {
  unsigned name = 0;
  glCreateBuffers(1, &name);
  return GlBuffer(name);
}

void fill_buffer(const GlBuffer& buffer, std::span<const std::byte> bytes) {
  glNamedBufferData(buffer.get(), static_cast<GLsizeiptr>(bytes.size()), bytes.data(),
                    GL_STREAM_DRAW);
}

GlVertexArray make_vertex_array() {
  unsigned name = 0;
  glCreateVertexArrays(1, &name);
  return GlVertexArray(name);
}

GlTexture make_texture(unsigned format, int width, int height, int samples, const char* what) {
  unsigned name = 0;
  if (samples > 1) {
    glCreateTextures(GL_TEXTURE_2D_MULTISAMPLE, 1, &name);
    glTextureStorage2DMultisample(name, samples, format, width, height, GL_TRUE);
  } else {
    glCreateTextures(GL_TEXTURE_2D, 1, &name);
    glTextureStorage2D(name, 1, format, width, height);
    glTextureParameteri(name, GL_TEXTURE_MIN_FILTER, GL_NEAREST);
    glTextureParameteri(name, GL_TEXTURE_MAG_FILTER, GL_NEAREST);
    glTextureParameteri(name, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
    glTextureParameteri(name, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);
  }
  GlTexture texture(name);
  check_gl(what);
  return texture;
}

GlFramebuffer make_framebuffer(std::span<const unsigned> colours, unsigned depth,
                               const char* what) {
  unsigned name = 0;
  glCreateFramebuffers(1, &name);
  GlFramebuffer framebuffer(name);
  std::vector<GLenum> buffers;
  for (const unsigned colour : colours) {
    const GLenum attachment = GL_COLOR_ATTACHMENT0 + static_cast<GLenum>(buffers.size());
    glNamedFramebufferTexture(name, attachment, colour, 0);
    buffers.push_back(attachment);
  }
  if (depth != 0) glNamedFramebufferTexture(name, GL_DEPTH_ATTACHMENT, depth, 0);
  glNamedFramebufferDrawBuffers(name, static_cast<GLsizei>(buffers.size()), buffers.data());
  check_gl(what);
  if (glCheckNamedFramebufferStatus(name, GL_FRAMEBUFFER) != GL_FRAMEBUFFER_COMPLETE)
    throw Error(fmt::format("OpenGL: {}: this driver does not support such a framebuffer", what));
  return framebuffer;
}

GlProgram make_program(const std::string& vertex, const std::string& fragment, const char* what) {
  const Shader first(GL_VERTEX_SHADER, vertex, what), second(GL_FRAGMENT_SHADER, fragment, what);
  GlProgram program(glCreateProgram());
  glAttachShader(program.get(), first.get());
  glAttachShader(program.get(), second.get());
  glLinkProgram(program.get());
  int good = 0;
  glGetProgramiv(program.get(), GL_LINK_STATUS, &good);
  if (!good) {
    int length = 0;
    glGetProgramiv(program.get(), GL_INFO_LOG_LENGTH, &length);
    std::string log(static_cast<std::size_t>(length), '\0');
    glGetProgramInfoLog(program.get(), length, nullptr, log.data());
    throw Error(fmt::format("OpenGL cannot link the shaders of {}: {}", what, log.c_str()));
  }
  check_gl(what);
  return program;
}

}  // namespace isobrick
