#pragma once

#include <memory>
#include <string>

namespace isobrick::inline v0 {

/// An OpenGL 4.5 core context without a window or a display, made with EGL: on the first hardware
/// device that supports it, else by Mesa in software. It is current in the thread that made it
/// until another one becomes current.
///
/// A context can be current in one thread at a time.
class GlContext {
 public:
  /// Throws Error, which lists what was tried, if there is no OpenGL 4.5.
  GlContext();
  ~GlContext();

  void make_current();
  /// Releases the context for another thread, which then calls make_current().
  void release_current();

  /// Whether GlContext() would succeed.
  static bool available();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// Describes an OpenGL context.
struct GlDevice {
  std::string renderer;  ///< "llvmpipe (LLVM 15.0.6, 256 bits)"
  std::string version;   ///< "4.5 (Core Profile) Mesa 22.3.6"
  bool software = false;
  bool nvidia = false;  ///< NVIDIA's driver, which serves CUDA as well
};

/// Describes the current context. Throws Error if it is older than OpenGL 4.5.
GlDevice current_gl_device();

}  // namespace isobrick
