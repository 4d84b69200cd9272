#pragma once

#include <array>

#include "isobrick/render/gl_objects.h"
#include "isobrick/render/picture_targets.h"
#include "isobrick/render/renderer.h"

namespace isobrick {

/// Turns what was drawn into a picture: nearest samples, occlusion, edges, blending,
/// the background.
class ScreenPass {
 public:
  /// For targets of this many samples.
  explicit ScreenPass(int samples);

  void run(const PictureTargets& targets, const PictureSettings& settings, bool transparent);

 private:
  const GlProgram& compose(const PictureSettings& settings, bool transparent);
  void draw(const GlProgram& program, const GlFramebuffer& target);

  int samples_;
  GlVertexArray nothing_;  ///< the triangle over all comes from its vertices' numbers
  GlProgram nearest_, occlusion_, smooth_;
  std::array<GlProgram, 8> compose_;  ///< by what they do; made when first wanted
};

}  // namespace isobrick
