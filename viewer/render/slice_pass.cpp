#include "viewer/render/slice_pass.h"

#include <epoxy/gl.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>

#include <isobrick/error.h>
#include "core/vectors.h"
#include "viewer/render/frame.h"

namespace isobrick::inline v0 {
namespace {

const char* const kVertex = R"(
layout(location = 0) uniform vec3 corner;
layout(location = 1) uniform vec3 along_x;
layout(location = 2) uniform vec3 along_y;
out vec2 uv;

void main() {
  uv = vec2(gl_VertexID & 1, gl_VertexID >> 1);
  place(corner + along_x * uv.x + along_y * uv.y);
}
)";

const char* const kColour = R"(
layout(binding = 0) uniform sampler2D samples;
layout(binding = 1) uniform sampler2D colours;
layout(location = 3) uniform vec3 window_opacity;  // first value, 1 / width, opacity
in vec2 uv;

// After all derivatives.
vec3 shown() {
  float value = texture(samples, uv).r;
  clip(~0u);
  if (isnan(value)) discard;
  float part = clamp((value - window_opacity.x) * window_opacity.y, 0.0, 1.0);
  int last = textureSize(colours, 0).x - 1;
  float at = part * float(last);
  int low = min(int(at), max(last - 1, 0));
  return mix(texelFetch(colours, ivec2(low, 0), 0).rgb,
             texelFetch(colours, ivec2(min(low + 1, last), 0), 0).rgb, at - float(low));
}
)";

// Alpha 0: a slice's colours are data, so no occlusion may change them.
const char* const kOpaque = R"(
layout(location = 0) out vec4 colour;
layout(location = 1) out vec2 normal;
layout(location = 2) out uint id;
void main() {
  vec3 position = here();
  vec3 facet = normalize(cross(dFdx(position), dFdy(position)));
  colour = vec4(shown(), 0);
  normal = facet.z < 0 ? -facet.xy : facet.xy;
  id = 0u;
}
)";

const char* const kTransparent = R"(
layout(location = 0) out vec4 sum;
layout(location = 1) out float hidden;
void main() {
  vec3 colour = shown();
  float depth = -here().z;
  sum = vec4(colour, 1) * window_opacity.z * weight_at(depth);
  hidden = window_opacity.z;
}
)";

constexpr std::array<Vec3f, 2> kGrey{{{0, 0, 0}, {1, 1, 1}}};

void set(const GlProgram& program, int location, Vec3f v) {
  glProgramUniform3f(program.get(), location, v.x, v.y, v.z);
}

}  // namespace

SlicePass::SlicePass() : no_attributes_(make_vertex_array()) {
  const std::string frame = kFrameGlsl, vertex = frame + kPlaceGlsl + kVertex,
                    fragment = frame + fragment_glsl(true) + kColour;
  opaque_ = make_program(vertex, fragment + kOpaque, "slices");
  transparent_ = make_program(vertex, fragment + kTransparent, "slices");
}

void SlicePass::add(const SliceImage& image) {
  if (image.width < 1 || image.height < 1 ||
      image.samples.size() !=
          static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height))
    throw UsageError(fmt::format("{} samples do not match a slice of {} x {}", image.samples.size(),
                                 image.width, image.height));
  Slice slice{image, make_texture(GL_R32F, image.width, image.height, 1, "a slice"), {}};
  glPixelStorei(GL_UNPACK_ALIGNMENT, 4);
  glTextureSubImage2D(slice.samples.get(), 0, 0, 0, image.width, image.height, GL_RED, GL_FLOAT,
                      image.samples.data());
  std::vector<glm::vec4> colours;
  for (const Vec3f& c : image.colours.empty() ? std::span<const Vec3f>(kGrey) : image.colours)
    colours.push_back(to_linear(c, 1));
  const auto count = static_cast<int>(colours.size());
  slice.colours = make_texture(GL_RGBA32F, count, 1, 1, "a colour map");
  glTextureSubImage2D(slice.colours.get(), 0, 0, 0, count, 1, GL_RGBA, GL_FLOAT, colours.data());
  check_gl("a slice");
  slices_.push_back(std::move(slice));
}

bool SlicePass::any(bool transparent) const {
  return std::any_of(slices_.begin(), slices_.end(),
                     [&](const Slice& slice) { return (slice.image.opacity < 1) == transparent; });
}

void SlicePass::draw(Vec3d eye, bool transparent) {
  const GlProgram& program = transparent ? transparent_ : opaque_;
  glUseProgram(program.get());
  glBindVertexArray(no_attributes_.get());
  for (const Slice& slice : slices_) {
    const SliceImage& image = slice.image;
    if ((image.opacity < 1) != transparent) continue;
    set(program, 0, to_float(image.corner - eye));
    set(program, 1, to_float(image.along_x));
    set(program, 2, to_float(image.along_y));
    const float width = image.window_hi - image.window_lo;
    set(program, 3, {image.window_lo, width != 0 ? 1 / width : 1e30f, image.opacity});
    glBindTextureUnit(0, slice.samples.get());
    glBindTextureUnit(1, slice.colours.get());
    glDrawArrays(GL_TRIANGLE_STRIP, 0, 4);
  }
  check_gl("drawing slices");
}

}  // namespace isobrick
