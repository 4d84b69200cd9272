#pragma once

#include <array>
#include <vector>

#include "viewer/render/gl_objects.h"
#include "viewer/render/picture_targets.h"
#include "viewer/render/renderer.h"

namespace isobrick {

/// What a picture is made of: what was drawn, and where the picture becomes whole.
struct ScreenPicture {
  const PictureTargets& targets;
  const PictureResult& result;
  const PictureSettings& settings;
  bool transparent;  ///< whether anything is
};

/// Rows of a picture, from the bottom.
struct PictureRows {
  int first, count;
};

/// Turns what was drawn into a picture: nearest samples, occlusion, edges, blending,
/// the background.
class ScreenPass {
 public:
  /// Each reads what those before have left, of other rows as well.
  enum class Step { nearest, occlusion, smooth_rows, smooth_columns, compose };

  /// For targets of this many samples.
  explicit ScreenPass(int samples);

  /// Those that a picture with these settings goes through, in order.
  static std::vector<Step> steps(const PictureSettings& settings);

  /// Takes some rows of the picture through a step.
  void run(Step step, const ScreenPicture& picture, PictureRows rows);

 private:
  void bind_samples(const ScreenPicture& picture);
  const GlProgram& compose(const PictureSettings& settings, bool transparent);
  void draw(const GlProgram& program, const GlFramebuffer& target);

  int samples_;
  GlVertexArray nothing_;  ///< the triangle over all comes from its vertices' numbers
  GlProgram nearest_, occlusion_, smooth_;
  std::array<GlProgram, 8> compose_;  ///< by what they do; made when first wanted
};

}  // namespace isobrick
