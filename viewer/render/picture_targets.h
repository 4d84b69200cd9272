#pragma once

#include <cstdint>
#include <glm/vec4.hpp>

#include "viewer/render/gl_objects.h"

namespace isobrick::inline v0 {

/// A picture, with the textures that picking and overlays read later.
struct PictureResult {
  PictureResult(int picture_width, int picture_height, bool with_ids);

  bool fits(int other_width, int other_height, bool with_ids) const {
    return width == other_width && height == other_height && ids == with_ids;
  }

  int width, height;
  bool ids;

  /// Copies the depths and ids of transparent meshes from where they were drawn.
  void take_front(const GlTexture& drawn);

  // For each pixel: depth (world length; 0: background), normal and id of the nearest opaque
  // sample.
  GlTexture near_depth, near_normal, near_id;
  GlFramebuffer nearest;
  // For each pixel: stored depth of the nearest transparent mesh; its last 8 bits hold the id
  // instead; 0: none.
  GlTexture front;
  bool has_front = false;
  GlTexture picture;
  GlFramebuffer picture_target;
};

/// The textures that a picture is drawn into, and their framebuffers.
struct PictureTargets {
  PictureTargets(int picture_width, int picture_height, int sample_count, bool with_ids);

  /// Makes the textures for transparent meshes, if they do not exist.
  void add_transparent();

  /// Total bytes of device memory, including one result.
  static std::uint64_t bytes(int width, int height, int samples, bool ids, bool transparent);

  int width, height, samples;
  bool ids;

  /// Positions of a pixel's samples, in pixels from its centre; 0 beyond `samples`.
  glm::vec4 samples_x{0}, samples_y{0};

  // For each sample: lit colour (alpha 0: occlusion does not apply), normal, id, depth.
  GlTexture colour, normal, id, depth;
  GlFramebuffer opaque;
  // For each sample: weighted sum of colours, and visible fraction of the background.
  GlTexture sum, transmittance;
  GlTexture front;  ///< with ids: see PictureResult
  GlFramebuffer transparent;
  // For each pixel: openness (1: no occlusion), and openness smoothed along rows.
  GlTexture openness, openness_rows;
  GlFramebuffer openness_target, openness_rows_target;

 private:
  void find_samples();
};

}  // namespace isobrick
