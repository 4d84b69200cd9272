#pragma once

#include <vector>

#include <isobrick/vec.h>
#include "viewer/render/gl_objects.h"
#include "viewer/render/renderer.h"

namespace isobrick::inline v0 {

/// Draws slices into the bound framebuffer.
class SlicePass {
 public:
  SlicePass();

  /// Copies a slice to the device, for the present picture. Throws UsageError for a size that does
  /// not match its samples.
  void add(const SliceImage& slice);
  void clear() { slices_.clear(); }
  /// Whether any slice is opaque (or transparent).
  bool any(bool transparent) const;
  void draw(Vec3d eye, bool transparent);

 private:
  struct Slice {
    SliceImage image;  ///< without its spans, which are copied
    GlTexture samples, colours;
  };

  std::vector<Slice> slices_;
  GlProgram opaque_, transparent_;
  GlVertexArray no_attributes_;  ///< empty: corners come from the vertex index
};

}  // namespace isobrick
