#include "viewer/render/overlay_pass.h"

#include <epoxy/gl.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "core/vectors.h"
#include "viewer/render/frame.h"

namespace isobrick::inline v0 {
namespace {

constexpr float kFontHeight = 40;
constexpr float kSmallestText = 11;  ///< pixels of a line, on a display without scaling

const char* const kVertex = R"(
layout(location = 0) in vec3 place;  // pixels from the top left; depth or its reciprocal
layout(location = 1) in vec2 inner;
layout(location = 2) in vec2 line;
layout(location = 3) in vec3 colour;
out vec2 uv;
noperspective out float depth;
flat out vec2 line_size;
flat out vec3 tint;

void main() {
  uv = inner;
  depth = place.z;
  line_size = line;
  tint = colour;
  gl_Position = vec4(place.xy / viewport.xy * vec2(2, -2) + vec2(-1, 1), 0, 1);
}
)";

const char* const kFragment = R"(
layout(binding = 0) uniform sampler2D atlas;
layout(binding = 1) uniform sampler2D near_depths;
layout(location = 0) uniform float left;
in vec2 uv;
noperspective in float depth;
flat in vec2 line_size;
flat in vec3 tint;
layout(location = 0) out vec4 picture;

void main() {
  if (line_size.x <= 0) {
    picture = vec4(tint, texture(atlas, uv).r);
    return;
  }
  // Distance from the segment, which has round ends.
  vec2 off = vec2(max(max(-uv.x, uv.x - line_size.y), 0.0), uv.y);
  float alpha = clamp(line_size.x + 0.5 - length(off), 0.0, 1.0);
  if (depth > 0) {
    float far = depth_range.z > 0.5 ? depth : 1 / depth;
    vec2 place = (gl_FragCoord.xy - vec2(left, 0)) * vec2(textureSize(near_depths, 0)) / viewport.xy;
    float seen = texelFetch(near_depths, ivec2(place), 0).r;
    if (seen > 0 && seen < far - 2 * pixel_length(far)) alpha *= 0.14;
  }
  picture = vec4(tint, alpha);
}
)";

std::string label(double length, const std::string& unit) {
  const std::string number = length >= 1e-3 && length < 1e6 ? fmt::format("{:.10g}", length)
                                                            : fmt::format("{:.0e}", length);
  return unit.empty() ? number : number + " " + unit;
}

}  // namespace

double round_length(double length) {
  const double power = std::pow(10, std::floor(std::log10(length)));
  for (const double digit : {5.0, 2.0})
    if (digit * power <= length) return digit * power;
  return power;
}

OverlayPass::OverlayPass()
    : font_(kFontHeight), vertices_(make_vertex_array()), buffer_(make_stream_buffer()) {
  const std::string frame = kFrameGlsl;
  program_ = make_program(frame + kVertex, frame + kFragment, "lines and text");
  atlas_ = make_texture(GL_R8, font_.edge(), font_.edge(), 1, "the font");
  glTextureParameteri(atlas_.get(), GL_TEXTURE_MIN_FILTER, GL_LINEAR);
  glTextureParameteri(atlas_.get(), GL_TEXTURE_MAG_FILTER, GL_LINEAR);
  glPixelStorei(GL_UNPACK_ALIGNMENT, 4);
  glTextureSubImage2D(atlas_.get(), 0, 0, 0, font_.edge(), font_.edge(), GL_RED, GL_UNSIGNED_BYTE,
                      font_.picture().data());
  const unsigned array = vertices_.get();
  glVertexArrayVertexBuffer(array, 0, buffer_.get(), 0, sizeof(Corner));
  const auto attribute = [&](unsigned index, int count, std::size_t offset) {
    glEnableVertexArrayAttrib(array, index);
    glVertexArrayAttribFormat(array, index, count, GL_FLOAT, GL_FALSE, static_cast<GLuint>(offset));
    glVertexArrayAttribBinding(array, index, 0);
  };
  attribute(0, 3, offsetof(Corner, x));
  attribute(1, 2, offsetof(Corner, u));
  attribute(2, 2, offsetof(Corner, half_width));
  attribute(3, 3, offsetof(Corner, red));
  check_gl("lines and text");
}

void OverlayPass::add_rectangle(const std::array<Corner, 4>& c) {
  for (const std::size_t i : {0u, 1u, 2u, 2u, 1u, 3u}) corners_.push_back(c[i]);
}

void OverlayPass::add_projected(Vec3d from, Vec3d to, Vec3f colour, float width) {
  const Vec3d along = Vec3d{to.x - from.x, to.y - from.y, 0};
  const double size = length(along);
  const Vec3d ahead = unit(along, {1, 0, 0}), beside{-ahead.y, ahead.x, 0};
  const double half = width / 2, reach = half + 1;
  std::array<Corner, 4> corners;
  for (std::size_t i = 0; i < 4; ++i) {
    const bool end = i & 2;
    const double u = end ? size + reach : -reach, v = i & 1 ? reach : -reach;
    const Vec3d at = from + ahead * u + beside * v;
    // Extended beyond the ends with the same slope, so that the depth in between is right.
    const double slope = size > 0 ? (to.z - from.z) / size : 0;
    const Vec3f p = to_float({at.x, at.y, from.z + slope * u});
    corners[i] = {p.x,
                  p.y,
                  p.z,
                  static_cast<float>(u),
                  static_cast<float>(v),
                  static_cast<float>(half),
                  static_cast<float>(size),
                  colour.x,
                  colour.y,
                  colour.z};
  }
  add_rectangle(corners);
}

void OverlayPass::add_flat_line(Vec3d from, Vec3d to, Vec3f colour, float width) {
  from.z = to.z = 0;
  add_projected(from, to, colour, width);
}

void OverlayPass::add_line(const WorldLine& line, Vec3f colour, float width) {
  std::array<Vec3d, 2> ends{line.from, line.to};
  // Clips the part behind the eye.
  const double near = camera_.orthographic ? -1e30 : camera_.near_depth();
  const auto depth = [&](Vec3d p) { return -dot(p - camera_.eye, camera_.back); };
  const double d0 = depth(ends[0]), d1 = depth(ends[1]);
  if (d0 < near && d1 < near) return;
  if (d0 < near || d1 < near) {
    const Vec3d clipped = ends[0] + (ends[1] - ends[0]) * ((near - d0) / (d1 - d0));
    ends[d0 < near ? 0 : 1] = clipped;
  }
  for (Vec3d& end : ends) {
    end = camera_.project(end, width_, height_);
    // In perspective the reciprocal depth is linear on the picture.
    if (!camera_.orthographic) end.z = 1 / std::max(end.z, near);
  }
  add_projected(ends[0], ends[1], colour, width);
}

double OverlayPass::text_width(const std::string& text, double line_height) const {
  return font_.width(text) * line_height / font_.height();
}

void OverlayPass::add_text(const std::string& text, double x, double y, double line_height,
                           Vec3f colour) {
  const double scale = line_height / font_.height();
  font_.place(text, [&](const Glyph& g, float pen) {
    std::array<Corner, 4> corners;
    for (std::size_t i = 0; i < 4; ++i) {
      const bool low = i & 2, right = i & 1;
      const Vec3f at = to_float({x + scale * (pen + (right ? g.x1 : g.x0)),
                                 y + scale * (font_.ascent() + (low ? g.y1 : g.y0)), 0});
      corners[i] = {at.x,     at.y,     0,       right ? g.u1 : g.u0, low ? g.v1 : g.v0, 0, 0,
                    colour.x, colour.y, colour.z};
    }
    add_rectangle(corners);
  });
}

float OverlayPass::unit_height() const {
  return std::max(static_cast<float>(std::min(width_, height_)) / 45, kSmallestText * scale_);
}

void OverlayPass::add_axes() {
  static constexpr std::array<Vec3f, 3> colours{
      {{0.80f, 0.20f, 0.18f}, {0.16f, 0.56f, 0.22f}, {0.16f, 0.34f, 0.78f}}};
  static constexpr std::array<const char*, 3> names{"x", "y", "z"};
  const double height = unit_height(), size = 2.6 * height;
  const Vec3d centre{1.5 * size, height_ - 1.5 * size, 0};
  std::array<int, 3> order{0, 1, 2};  // farthest first
  std::sort(order.begin(), order.end(),
            [&](int a, int b) { return camera_.back[a] < camera_.back[b]; });
  for (const int axis : order) {
    const Vec3d ahead{camera_.right[axis], -camera_.up[axis], 0};
    const Vec3f colour = colours[static_cast<std::size_t>(axis)];
    add_flat_line(centre, centre + ahead * size, colour, static_cast<float>(height / 7));
    const Vec3d at = centre + ahead * (size + 0.55 * height);
    const std::string name = names[static_cast<std::size_t>(axis)];
    add_text(name, at.x - text_width(name, height) / 2, at.y - 0.58 * height, height, colour);
  }
}

void OverlayPass::add_scale_bar(const Overlays::ScaleBar& bar) {
  const double pixel =
      camera_.extent_at(camera_.distance()) / std::min(width_, height_) / bar.unit_length;
  const double max_length = 0.22 * width_ * pixel;
  if (!(max_length > 0) || !std::isfinite(max_length)) return;
  const double size = round_length(max_length), pixels = size / pixel, height = unit_height();
  const Vec3f dark{0.16f, 0.18f, 0.21f};
  const Vec3d right{width_ - 1.4 * height, height_ - 1.4 * height, 0};
  const Vec3d left = right - Vec3d{pixels, 0, 0}, tick{0, 0.28 * height, 0};
  const auto thick = static_cast<float>(height / 9);
  add_flat_line(left, right, dark, thick);
  for (const Vec3d end : {left, right}) add_flat_line(end - tick, end + tick, dark, thick);
  const std::string text = label(size, bar.unit);
  add_text(text, left.x + (pixels - text_width(text, height)) / 2, right.y - 1.5 * height, height,
           dark);
}

void OverlayPass::run(const Overlays& overlays, const Camera& camera, unsigned framebuffer,
                      int width, int height, const GlTexture& near_depth, int left) {
  camera_ = camera;
  scale_ = overlays.scale;
  width_ = width;
  height_ = height;
  corners_.clear();
  for (const Overlays::Line& l : overlays.lines) add_line(l.line, l.colour, l.width * scale_);
  if (overlays.axes) add_axes();
  if (overlays.scale_bar) add_scale_bar(*overlays.scale_bar);
  if (corners_.empty()) return;
  fill_buffer(buffer_, std::as_bytes(std::span(corners_)));
  glBindFramebuffer(GL_FRAMEBUFFER, framebuffer);
  glViewport(left, 0, width, height);
  glUseProgram(program_.get());
  glUniform1f(0, static_cast<float>(left));
  glBindVertexArray(vertices_.get());
  glBindTextureUnit(0, atlas_.get());
  glBindTextureUnit(1, near_depth.get());
  glEnable(GL_BLEND);
  glBlendFuncSeparate(GL_SRC_ALPHA, GL_ONE_MINUS_SRC_ALPHA, GL_ZERO, GL_ONE);
  glDrawArrays(GL_TRIANGLES, 0, static_cast<GLsizei>(corners_.size()));
  glDisable(GL_BLEND);
  glBlendFunc(GL_ONE, GL_ZERO);
  check_gl("lines and text");
}

}  // namespace isobrick
