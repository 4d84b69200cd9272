#pragma once

#include <array>
#include <glm/mat4x4.hpp>
#include <glm/vec4.hpp>
#include <string>

#include "viewer/render/camera.h"
#include "viewer/render/gl_objects.h"
#include "viewer/render/renderer.h"

namespace isobrick {

/// Planes and box faces that cut.
inline constexpr int kMaxHalfSpaces = 12;
/// Of a pixel, with multisampling.
inline constexpr int kSamples = 4;

/// What every shader knows of the picture: the uniform block Frame of frame_glsl.
struct FrameBlock {
  glm::mat4 projection, rotation;
  /// dot(xyz, position relative to the eye) + w >= 0 is kept.
  std::array<glm::vec4, kMaxHalfSpaces> half_spaces;
  glm::vec4 depth;        ///< near, far, orthographic, 1 / depth of the scene
  glm::vec4 viewport;     ///< width, height, half width and half height at depth 1 (or everywhere)
  glm::vec4 pixel;        ///< length of a pixel at depth 1 (or everywhere)
  glm::vec4 top, bottom;  ///< background, linear
  /// Half spaces, whether picking, all samples of a pixel as bits.
  glm::ivec4 counts;
  glm::vec4 samples_x, samples_y;  ///< where a pixel's samples lie, pixels from its middle
};

FrameBlock make_frame(const Camera& camera, int width, int height, const PictureSettings& settings);

/// GLSL: the block Frame and functions of depth and camera space.
extern const char* const kFrameGlsl;
/// GLSL for vertex shaders, after kFrameGlsl: place(position from the eye).
extern const char* const kPlaceGlsl;
/// GLSL for fragment shaders, after kFrameGlsl: here(), where the fragment is; and if `cut`
/// cut(bits), which drops the samples that lie outside of any of these half spaces. What has
/// nothing to drop can be hidden before it is shaded.
std::string fragment_glsl(bool clips);
/// GLSL: light on a surface, after kFrameGlsl.
extern const char* const kLightGlsl;

/// sRGB in [0, 1] to linear.
glm::vec4 to_linear(Vec3f colour, float alpha);

}  // namespace isobrick
