#pragma once

#include <memory>
#include <string>

namespace isobrick {

/// An OpenGL 4.5 core context without a window or a display, made with EGL: on the
/// first hardware device that has one, else by Mesa in software. The
/// context is current in the thread that made it until another becomes current.
///
/// A context may be current in one thread at a time.
class GlContext {
 public:
  /// Throws Error, with what was tried, when there is no OpenGL 4.5 here.
  GlContext();
  ~GlContext();

  void make_current();
  /// For a move to another thread, which then calls make_current.
  void release_current();

  /// Whether GlContext() would succeed.
  static bool available();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// The context at hand, whoever made it.
struct GlDevice {
  std::string renderer;  ///< "llvmpipe (LLVM 15.0.6, 256 bits)"
  std::string version;   ///< "4.5 (Core Profile) Mesa 22.3.6"
  bool software = false;
  bool nvidia = false;  ///< drawn by NVIDIA's driver, which is that of CUDA as well
};

/// Describes the current context. Throws Error if it is older than OpenGL 4.5.
GlDevice current_gl_device();

}  // namespace isobrick
