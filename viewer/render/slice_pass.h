#pragma once

#include <vector>

#include <isobrick/vec.h>
#include "viewer/render/gl_objects.h"
#include "viewer/render/renderer.h"

namespace isobrick {

/// Draws slices into the framebuffer that is bound.
class SlicePass {
 public:
  SlicePass();

  /// Copies a slice to the device, for the picture at hand. Throws UsageError for a
  /// size that does not fit its samples.
  void add(const SliceImage& slice);
  void clear() { slices_.clear(); }
  /// Whether any is opaque (transparent).
  bool any(bool transparent) const;
  void draw(Vec3d eye, bool transparent);

 private:
  struct Slice {
    SliceImage image;  ///< its spans are not used any more
    GlTexture samples, colours;
  };

  std::vector<Slice> slices_;
  GlProgram opaque_, transparent_;
  GlVertexArray nothing_;  ///< corners come from their numbers
};

}  // namespace isobrick
