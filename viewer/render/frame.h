#pragma once

#include <array>
#include <glm/mat4x4.hpp>
#include <glm/vec4.hpp>
#include <string>

#include "viewer/render/camera.h"
#include "viewer/render/gl_objects.h"
#include "viewer/render/renderer.h"

namespace isobrick::inline v0 {

/// Maximum number of clip planes and faces of the clip box together.
inline constexpr int kMaxHalfSpaces = 12;
/// Samples per pixel with multisampling.
inline constexpr int kSamples = 4;

/// The uniform block Frame of kFrameGlsl, which every shader reads.
struct FrameBlock {
  glm::mat4 projection, rotation;
  /// A point is kept where dot(xyz, position relative to the eye) + w >= 0.
  std::array<glm::vec4, kMaxHalfSpaces> half_spaces;
  glm::vec4 depth;  ///< near, far, orthographic, 1 / depth of the scene
  /// Width, height; half width and half height at depth 1 (anywhere if orthographic).
  glm::vec4 viewport;
  glm::vec4 pixel;        ///< length of a pixel at depth 1 (anywhere if orthographic)
  glm::vec4 top, bottom;  ///< background, linear
  /// Number of half spaces; whether picking; mask of all samples of a pixel.
  glm::ivec4 counts;
  glm::vec4 samples_x, samples_y;  ///< positions of a pixel's samples, in pixels from its centre
};

FrameBlock make_frame(const Camera& camera, int width, int height, const PictureSettings& settings);

/// GLSL: the block Frame, and functions for depth and camera space.
extern const char* const kFrameGlsl;
/// GLSL for vertex shaders, after kFrameGlsl: place(position from the eye).
extern const char* const kPlaceGlsl;
/// GLSL for fragment shaders, after kFrameGlsl: here(), the fragment's position. With `clips` also
/// clip(bits), which drops the samples outside any of these half spaces. Without it the hardware
/// can test depth before it shades.
std::string fragment_glsl(bool clips);
/// GLSL, after kFrameGlsl: lighting of a surface.
extern const char* const kLightGlsl;

/// Converts sRGB in [0, 1] to linear colour.
glm::vec4 to_linear(Vec3f colour, float alpha);

}  // namespace isobrick
