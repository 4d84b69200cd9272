#pragma once

#include <cstdint>
#include <glm/vec4.hpp>

#include "viewer/render/gl_objects.h"

namespace isobrick {

/// A picture, and what is kept of it beside its colours: what picking and lines read.
struct PictureResult {
  PictureResult(int picture_width, int picture_height, bool with_ids);

  bool fits(int other_width, int other_height, bool with_ids) const {
    return width == other_width && height == other_height && ids == with_ids;
  }

  int width, height;
  bool ids;

  /// Takes what is known of transparent meshes over from where it was drawn.
  void take_front(const GlTexture& drawn);

  // Of each pixel: the nearest opaque sample's depth (world length; 0: background), normal, mesh.
  GlTexture near_depth, near_normal, near_id;
  GlFramebuffer nearest;
  // Of each pixel: the nearest transparent mesh's depth, as it is stored and but for its last 8
  // bits, which are those of its number; 0: none.
  GlTexture front;
  bool has_front = false;
  GlTexture picture;
  GlFramebuffer picture_target;
};

/// The textures that a picture goes through, and framebuffers of them.
struct PictureTargets {
  PictureTargets(int picture_width, int picture_height, int sample_count, bool with_ids);

  /// Those of transparent meshes, made when the first one comes.
  void add_transparent();

  /// Device memory in all, with that of one result.
  static std::uint64_t bytes(int width, int height, int samples, bool ids, bool transparent);

  int width, height, samples;
  bool ids;

  /// Where a pixel's samples lie, pixels from its middle; 0 beyond `samples`.
  glm::vec4 samples_x{0}, samples_y{0};

  // Of each sample: lit colour (alpha 0: no light is taken away later), normal, mesh, depth.
  GlTexture colour, normal, id, depth;
  GlFramebuffer opaque;
  // Of each sample: weighted sum, and what part of the background is still seen.
  GlTexture sum, seen;
  GlTexture front;  ///< with ids: see PictureResult
  GlFramebuffer transparent;
  // Of each pixel: how open it is, and that smoothed along rows.
  GlTexture open, open_rows;
  GlFramebuffer open_target, open_rows_target;

 private:
  void find_samples();
};

}  // namespace isobrick
