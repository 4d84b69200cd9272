#pragma once

#include <array>
#include <vector>

#include "viewer/render/gl_objects.h"
#include "viewer/render/picture_targets.h"
#include "viewer/render/renderer.h"

namespace isobrick::inline v0 {

/// Input and output of the screen steps.
struct ScreenPicture {
  const PictureTargets& targets;
  const PictureResult& result;
  const PictureSettings& settings;
  bool transparent;  ///< whether any mesh or slice is
};

/// Rows of a picture, from the bottom.
struct PictureRows {
  int first, count;
};

/// Makes a picture from the drawn samples: nearest samples, occlusion, edges, blending, background.
class ScreenPass {
 public:
  /// Each step reads the results of the previous ones, also in other rows.
  enum class Step { nearest, occlusion, smooth_rows, smooth_columns, compose };

  /// `samples`: per pixel of the targets.
  explicit ScreenPass(int samples);

  /// The steps of a picture with these settings, in order.
  static std::vector<Step> steps(const PictureSettings& settings);

  /// Runs a step on some rows.
  void run(Step step, const ScreenPicture& picture, PictureRows rows);

 private:
  void bind_samples(const ScreenPicture& picture);
  const GlProgram& compose(const PictureSettings& settings, bool transparent);
  void draw(const GlProgram& program, const GlFramebuffer& target);

  int samples_;
  GlVertexArray
      no_attributes_;  ///< empty: vertices of the full-screen triangle come from their index
  GlProgram nearest_, occlusion_, smooth_;
  std::array<GlProgram, 8> compose_;  ///< variants, made at first use
};

}  // namespace isobrick
