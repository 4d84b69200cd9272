#pragma once

#include <epoxy/gl.h>

#include <array>
#include <initializer_list>

#include "viewer/render/frame.h"

namespace isobrick::inline v0 {

/// Sets the context's state for drawing; restores OpenGL's defaults.
class DrawSwitches {
 public:
  explicit DrawSwitches(const FrameBlock& frame) {
    glGetIntegerv(GL_VIEWPORT, viewport_.data());
    glViewport(0, 0, static_cast<int>(frame.viewport.x), static_cast<int>(frame.viewport.y));
    glClipControl(GL_LOWER_LEFT, GL_ZERO_TO_ONE);
    glDepthFunc(GL_GREATER);
    glPolygonMode(GL_FRONT_AND_BACK, GL_FILL);
    for (const GLenum off :
         std::initializer_list<GLenum>{GL_BLEND, GL_CULL_FACE, GL_SCISSOR_TEST, GL_STENCIL_TEST,
                                       GL_FRAMEBUFFER_SRGB, GL_DEPTH_TEST})
      glDisable(off);
    glColorMask(GL_TRUE, GL_TRUE, GL_TRUE, GL_TRUE);
  }
  ~DrawSwitches() {
    meshes(false, false);
    glClipControl(GL_LOWER_LEFT, GL_NEGATIVE_ONE_TO_ONE);
    glDepthFunc(GL_LESS);
    glViewport(viewport_[0], viewport_[1], viewport_[2], viewport_[3]);
    glBindFramebuffer(GL_FRAMEBUFFER, 0);
    glUseProgram(0);
    glBindVertexArray(0);
  }
  DrawSwitches(const DrawSwitches&) = delete;
  DrawSwitches& operator=(const DrawSwitches&) = delete;

  /// Sets the depth test and the weighted blending for meshes.
  void meshes(bool depth_test, bool blended) const {
    set(GL_DEPTH_TEST, depth_test);
    glDepthMask(!blended);
    set(GL_BLEND, blended);
    if (!blended) return;
    glBlendFunci(0, GL_ONE, GL_ONE);
    glBlendFunci(1, GL_ZERO, GL_ONE_MINUS_SRC_COLOR);
  }

 private:
  static void set(GLenum what, bool on) { on ? glEnable(what) : glDisable(what); }

  std::array<int, 4> viewport_{};
};

}  // namespace isobrick
