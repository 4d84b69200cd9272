#include "viewer/render/frame.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/trigonometric.hpp>

#include "core/vectors.h"

namespace isobrick::inline v0 {
namespace {

float to_linear(float v) {
  v = std::clamp(v, 0.0f, 1.0f);
  return v <= 0.04045f ? v / 12.92f : std::pow((v + 0.055f) / 1.055f, 2.4f);
}

/// Differences to the eye in double, so that nothing jitters far from the world's origin.
glm::vec4 from_eye(const HalfSpace& half, Vec3d eye) {
  const double size = length(half.normal);
  const Vec3f n = to_float(half.normal * (1 / size));
  return {n.x, n.y, n.z, static_cast<float>((dot(half.normal, eye) - half.least) / size)};
}

}  // namespace

glm::vec4 to_linear(Vec3f colour, float alpha) {
  return {to_linear(colour.x), to_linear(colour.y), to_linear(colour.z), alpha};
}

std::vector<HalfSpace> PictureSettings::half_spaces() const {
  std::vector<HalfSpace> all = planes;
  for (int axis = 0; region && axis < 3; ++axis) {
    Vec3d inward;
    inward[axis] = 1;
    all.push_back(half_space_at(region->lo, inward));
    all.push_back(half_space_at(region->hi, inward * -1.0));
  }
  return all;
}

FrameBlock make_frame(const Camera& camera, int width, int height,
                      const PictureSettings& settings) {
  FrameBlock frame{};
  const double aspect = static_cast<double>(width) / height;
  frame.projection = glm::mat4(camera.projection(aspect));
  frame.rotation = glm::mat4(glm::mat3(camera.rotation()));

  int count = 0;
  for (const HalfSpace& half : settings.half_spaces())
    frame.half_spaces[static_cast<std::size_t>(count++)] = from_eye(half, camera.eye);
  frame.counts = {count, settings.picking ? 1 : 0, settings.multisample ? (1 << kSamples) - 1 : 1,
                  0};

  const double near = camera.near_depth(), far = camera.far_depth();
  const double tangent = std::tan(glm::radians(camera.field_of_view) / 2);
  const double shorter = camera.orthographic ? tangent * camera.distance() : tangent;
  const double pixel = 2 * shorter / std::min(width, height);
  frame.depth = {static_cast<float>(near), static_cast<float>(far),
                 camera.orthographic ? 1.0f : 0.0f, static_cast<float>(1 / (far - near))};
  frame.viewport = {static_cast<float>(width), static_cast<float>(height),
                    static_cast<float>(pixel * width / 2), static_cast<float>(pixel * height / 2)};
  frame.pixel = {static_cast<float>(pixel), 0, 0, 0};
  frame.top = to_linear(settings.background_top, 1);
  frame.bottom = to_linear(settings.background_bottom, 1);
  return frame;
}

const char* const kFrameGlsl = R"(
layout(std140, binding = 0) uniform Frame {
  mat4 projection, rotation;
  vec4 half_spaces[12];
  vec4 depth_range;
  vec4 viewport;
  vec4 pixel;
  vec4 background_top, background_bottom;
  ivec4 counts;
  vec4 samples_x, samples_y;
};

// World length in front of the eye, from a value of the depth buffer.
float depth_of(float stored) {
  return depth_range.z > 0.5 ? depth_range.y - stored * (depth_range.y - depth_range.x)
                             : depth_range.x / stored;
}
vec3 view_position(vec2 at, float depth) {
  vec2 across = (at / viewport.xy * 2 - 1) * viewport.zw;
  return vec3(depth_range.z > 0.5 ? across : across * depth, -depth);
}
float pixel_length(float depth) { return depth_range.z > 0.5 ? pixel.x : pixel.x * depth; }
vec3 towards_eye(vec3 position) {
  return depth_range.z > 0.5 ? vec3(0, 0, 1) : normalize(-position);
}
// The unit vector towards the eye with the given x and y.
vec3 normal_of(vec2 xy) { return vec3(xy, sqrt(max(1 - dot(xy, xy), 0.0))); }
// Weight of a transparent fragment: larger for nearer ones, within the range of half floats.
float weight_at(float depth) {
  return 64 * exp2(-12 * clamp((depth - depth_range.x) * depth_range.w, 0.0, 1.0));
}
)";

const char* const kPlaceGlsl = R"(
// The same expression in all variants, or meshes drawn by different ones would not meet.
invariant gl_Position;

void place(vec3 from_eye) { gl_Position = projection * vec4(mat3(rotation) * from_eye, 1); }
)";

namespace {

// Small triangles are bound by the size of the interpolated vertex outputs, and clip distances use
// a slower path. So vertices pass neither their position nor distances to planes.
const char* const kHereGlsl = R"(
// Camera space, at the pixel's centre. If that is beside the triangle, the point is on the
// triangle's plane, but for a triangle seen edge-on not behind everything.
vec3 here() {
  float farthest = depth_range.z > 0.5 ? 0.0 : 0.5 * depth_range.x / depth_range.y;
  return view_position(gl_FragCoord.xy, depth_of(max(gl_FragCoord.z, farthest)));
}
)";

const char* const kClipGlsl = R"(
// A half space is tested with a value that is linear on the picture: the distance, in perspective
// multiplied by the stored depth instead of divided.
void clip(uint bits) {
  vec2 across = (gl_FragCoord.xy / viewport.xy * 2 - 1) * viewport.zw;
  bool parallel = depth_range.z > 0.5;
  vec3 at = parallel ? vec3(across, -depth_of(gl_FragCoord.z)) : vec3(across, -1) * depth_range.x;
  float scale = parallel ? 1.0 : gl_FragCoord.z;
  ivec4 kept = ivec4(1, 2, 4, 8);
  for (int i = 0; i < counts.x; ++i) {
    if ((bits >> i & 1u) == 0u) continue;
    float middle = dot(mat3(rotation) * half_spaces[i].xyz, at) + half_spaces[i].w * scale;
    vec4 there = middle + samples_x * dFdx(middle) + samples_y * dFdy(middle);
    kept *= ivec4(greaterThanEqual(there, vec4(0)));
  }
  int mask = (kept.x | kept.y | kept.z | kept.w) & counts.z;
  if (mask == 0) discard;
  gl_SampleMask[0] = mask;
}
)";

}  // namespace

std::string fragment_glsl(bool clips) {
  std::string text = kHereGlsl;
  text += clips ? kClipGlsl : "void clip(uint bits) {}\n";
  return text;
}

const char* const kLightGlsl = R"(
// Light that a surface reflects to the eye, linear; arguments in camera space. A key light from
// above and left, sky and ground, a little light from the eye, gloss and a bright rim.
vec3 lit(vec3 normal, vec3 eye, vec3 colour) {
  const vec3 key = normalize(vec3(-0.46, 0.64, 0.62));
  const vec3 fill = normalize(vec3(0.75, 0.05, 0.45));
  const vec3 sky = vec3(0.97, 0.99, 1.05), ground = vec3(0.62, 0.57, 0.53);
  float facing = clamp(dot(normal, eye), 0.0, 1.0);
  float wrapped = (dot(normal, key) + 0.15) / 1.15;
  vec3 light = mix(ground, sky, 0.5 + 0.5 * normal.y) * 0.26;
  light += vec3(1.0, 0.985, 0.95) * 0.80 * max(wrapped, 0.0);
  light += vec3(0.92, 0.96, 1.0) * (0.10 * max(dot(normal, fill), 0.0) + 0.08 * facing);
  vec3 halfway = normalize(key + eye);
  float gloss = pow(max(dot(normal, halfway), 0.0), 48.0);
  float rim = pow(1.0 - facing, 4.0) * (0.55 + 0.45 * normal.y);
  return colour * light + vec3(0.11 * gloss + 0.07 * rim);
}
)";

}  // namespace isobrick
