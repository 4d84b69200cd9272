#pragma once

#include <array>
#include <cstdint>
#include <glm/mat4x4.hpp>
#include <glm/vec4.hpp>
#include <string>

#include "isobrick/render/camera.h"
#include "isobrick/render/gl_objects.h"
#include "isobrick/render/renderer.h"

namespace isobrick {

/// Planes and box faces that cut; what OpenGL must offer clips exactly, the rest by pixel.
inline constexpr int kMostHalfSpaces = 12, kClipDistances = 8;
/// Of a pixel, with multisampling.
inline constexpr int kSamples = 4;

/// What every shader knows of the picture: the uniform block Frame of frame_glsl.
struct FrameBlock {
  glm::mat4 projection, rotation;
  /// dot(xyz, position relative to the eye) + w >= 0 is kept.
  std::array<glm::vec4, kMostHalfSpaces> half_spaces;
  glm::vec4 depth;        ///< near, far, orthographic, 1 / depth of the scene
  glm::vec4 viewport;     ///< width, height, half width and half height at depth 1 (or everywhere)
  glm::vec4 pixel;        ///< length of a pixel at depth 1 (or everywhere)
  glm::vec4 top, bottom;  ///< background, linear
  /// Clip distances, half spaces, whether picking, all samples of a pixel as bits.
  glm::ivec4 counts;
};

FrameBlock make_frame(const Camera& camera, int width, int height, const PictureSettings& settings);

/// GLSL: the block Frame and functions of depth and camera space.
extern const char* const kFrameGlsl;
/// By how many half spaces something may be cut. The fewer distances vertices have to them the
/// sooner small triangles are drawn, and fragments that never go can be hidden before they are
/// shaded.
enum class CutBy : std::uint8_t { none, few, all };
/// Clip distances of what is cut by few.
inline constexpr int kFew = 4;
/// GLSL: which of them a shader is for.
std::string cut_glsl(CutBy cut);
/// GLSL: cutting by the half spaces, in vertex and in fragment shaders; after kFrameGlsl and
/// cut_glsl().
extern const char* const kCutVertexGlsl;
extern const char* const kCutFragmentGlsl;
/// GLSL: light on a surface, after kFrameGlsl.
extern const char* const kLightGlsl;

/// sRGB in [0, 1] to linear.
glm::vec4 to_linear(Vec3f colour, float alpha);

}  // namespace isobrick
