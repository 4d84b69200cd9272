#include "viewer/render/screen_pass.h"

#include <epoxy/gl.h>
#include <fmt/format.h>

#include <array>

#include "viewer/render/frame.h"

namespace isobrick::inline v0 {
namespace {

const char* const kVertex = R"(
void main() {
  vec2 at = vec2(gl_VertexID == 1 ? 3 : -1, gl_VertexID == 2 ? 3 : -1);
  gl_Position = vec4(at, 0, 1);
}
)";

/// Samplers for multisampled textures, or for textures with one sample per pixel.
std::string sampled(int samples) {
  return samples > 1 ? fmt::format(
                           "#define SAMPLES {}\n#define PICTURE sampler2DMS\n"
                           "#define UPICTURE usampler2DMS\n#define AT(i) i\n",
                           samples)
                     : "#define SAMPLES 1\n#define PICTURE sampler2D\n"
                       "#define UPICTURE usampler2D\n#define AT(i) 0\n";
}

const char* const kNearest = R"(
layout(binding = 0) uniform PICTURE normals;
layout(binding = 1) uniform PICTURE depths;
layout(binding = 2) uniform UPICTURE ids;
layout(location = 0) uniform bool has_ids;
layout(location = 0) out float near_depth;
layout(location = 1) out vec2 near_normal;
layout(location = 2) out uint near_id;

void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  float stored = 0, farthest = 1e30, sum = 0;
  int nearest = 0;
  for (int i = 0; i < SAMPLES; ++i) {
    float other = texelFetch(depths, at, AT(i)).r;
    if (other > stored) { stored = other; nearest = i; }
    farthest = min(farthest, other);
    sum += other;
  }
  near_depth = stored > 0 ? depth_of(stored) : 0.0;
  // Samples lie around the pixel's centre; the stored depth is linear on the picture.
  if (farthest > 0 && depth_of(farthest) < near_depth + 8 * pixel_length(near_depth))
    near_depth = depth_of(sum / float(SAMPLES));
  near_normal = texelFetch(normals, at, AT(nearest)).rg;
  near_id = has_ids && stored > 0 ? texelFetch(ids, at, AT(nearest)).r : 0u;
}
)";

/// Scalable ambient obscurance (McGuire, Mara, Luebke 2012) at two radii: one for creases, one for
/// cavities.
const char* const kOcclusion = R"(
layout(binding = 0) uniform sampler2D depths;
layout(binding = 1) uniform sampler2D normals;
layout(location = 0) out float openness;

float closed_within(ivec2 at, vec3 p, vec3 n, float turn, float pixels) {
  const int count = 14;
  float radius = pixels * pixel_length(-p.z);
  float radius2 = radius * radius, sum = 0;
  for (int i = 0; i < count; ++i) {
    float part = (float(i) + 0.5) / float(count);
    float angle = turn + float(i) * 2.399963;
    ivec2 there = at + ivec2(round(vec2(cos(angle), sin(angle)) * part * pixels));
    if (there == at || any(lessThan(there, ivec2(0))) || any(greaterThanEqual(there, ivec2(viewport.xy))))
      continue;
    float depth = texelFetch(depths, there, 0).r;
    if (depth <= 0) continue;
    vec3 v = view_position(vec2(there) + 0.5, depth) - p;
    float vv = dot(v, v), vn = dot(v, n);
    // Surfaces far in front occlude a deep cavity a little, too.
    float near = 1 / (1 + vv / (1.5 * radius2));
    sum += near * max(vn - 0.02 * radius, 0.0) * inversesqrt(vv + 1e-4 * radius2);
  }
  return sum * 2.6 / float(count);
}

void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  float depth = texelFetch(depths, at, 0).r;
  openness = 1;
  if (depth <= 0) return;
  vec3 p = view_position(gl_FragCoord.xy, depth);
  vec3 n = normal_of(texelFetch(normals, at, 0).rg);
  float turn = 6.2831853 * fract(52.9829189 * fract(dot(vec2(at), vec2(0.06711056, 0.00583715))));
  float shorter = min(viewport.x, viewport.y);
  float fine = closed_within(at, p, n, turn, max(0.018 * shorter, 4));
  float coarse = closed_within(at, p, n, turn + 1.2, max(0.085 * shorter, 12));
  openness = 1 / ((1 + 0.8 * fine) * (1 + 1.8 * coarse));
}
)";

/// Smooths along rows, then along columns; not across steps in depth.
const char* const kSmooth = R"(
layout(binding = 0) uniform sampler2D depths;
layout(binding = 1) uniform sampler2D rough;
layout(location = 0) uniform ivec2 step_;
layout(location = 0) out float openness;

void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  float depth = texelFetch(depths, at, 0).r;
  openness = 1;
  if (depth <= 0) return;
  float sum = 0, weights = 0, length = pixel_length(depth);
  for (int i = -4; i <= 4; ++i) {
    ivec2 there = clamp(at + i * step_, ivec2(0), ivec2(viewport.xy) - 1);
    float other = texelFetch(depths, there, 0).r;
    float apart = abs(other - depth) / (length * (2.0 + 3.0 * abs(float(i))));
    float weight = other > 0 ? exp(-float(i * i) / 10.0) * max(1 - apart, 0.0) : 0.0;
    if (i == 0) weight = 1;
    sum += weight * texelFetch(rough, there, 0).r;
    weights += weight;
  }
  openness = sum / weights;
}
)";

const char* const kCompose = R"(
layout(binding = 0) uniform PICTURE colours;
layout(binding = 1) uniform PICTURE depths;
layout(binding = 2) uniform PICTURE sums;
layout(binding = 3) uniform PICTURE transmittances;
layout(binding = 4) uniform sampler2D near_depths;
layout(binding = 5) uniform sampler2D near_normals;
layout(binding = 6) uniform sampler2D openness_map;
layout(location = 0) out vec4 picture;

vec3 normal_at(ivec2 at) { return normal_of(texelFetch(near_normals, at, 0).rg); }

// Strength of an edge in the pixel: a farther surface begins beside it, or the surface has a
// crease.
float edge_at(ivec2 at) {
  float depth = texelFetch(near_depths, at, 0).r;
  if (depth <= 0) return 0;
  vec3 p = view_position(vec2(at) + 0.5, depth), n = normal_at(at);
  float length = pixel_length(depth), sum = 0;
  float reach = max(min(viewport.x, viewport.y) / 900.0, 1.0);
  for (int i = 0; i < 8; ++i) {
    float angle = float(i) * 0.78539816;
    ivec2 there = at + ivec2(round(vec2(cos(angle), sin(angle)) * reach));
    there = clamp(there, ivec2(0), ivec2(viewport.xy) - 1);
    float other = texelFetch(near_depths, there, 0).r;
    float far = 1, bend = 0;
    if (other > 0) {
      vec3 q = view_position(vec2(there) + 0.5, other);
      far = smoothstep(5.0, 16.0, dot(n, p - q) / (length * reach));
      if (other < depth + 4 * length * reach)
        bend = smoothstep(0.35, 0.9, 1 - dot(n, normal_at(there)));
    }
    sum += max(far, 0.7 * bend);
  }
  return clamp(sum / 4, 0.0, 1.0);
}

vec3 to_srgb(vec3 v) {
  v = clamp(v, 0.0, 1.0);
  return mix(12.92 * v, 1.055 * pow(v, vec3(1 / 2.4)) - 0.055, greaterThan(v, vec3(0.0031308)));
}

void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  vec3 behind = mix(background_bottom.rgb, background_top.rgb, gl_FragCoord.y / viewport.y);
  float openness = OCCLUSION ? texelFetch(openness_map, at, 0).r : 1.0;
#if EDGES
  openness *= 1 - 0.8 * edge_at(at);
#endif
  vec3 mean = vec3(0);
  for (int i = 0; i < SAMPLES; ++i) {
    vec3 colour = behind;
    if (texelFetch(depths, at, AT(i)).r > 0) {
      vec4 surface = texelFetch(colours, at, AT(i));
      colour = surface.rgb * mix(1.0, openness, surface.a);
    }
#if TRANSPARENT
    float transmittance = texelFetch(transmittances, at, AT(i)).r;
    vec4 sum = texelFetch(sums, at, AT(i));
    if (transmittance < 1 && sum.a > 0) colour = mix(sum.rgb / sum.a, colour, transmittance);
#endif
    // Bright samples are clamped before averaging, or edges beside them would be jagged.
    mean += min(colour, vec3(1));
  }
  picture = vec4(to_srgb(mean / float(SAMPLES)), 1);
}
)";

void bind(unsigned unit, const GlTexture& texture) { glBindTextureUnit(unit, texture.get()); }

}  // namespace

ScreenPass::ScreenPass(int samples) : samples_(samples), no_attributes_(make_vertex_array()) {
  const std::string frame = kFrameGlsl, variant = sampled(samples);
  nearest_ = make_program(kVertex, variant + frame + kNearest, "the nearest samples");
  occlusion_ = make_program(kVertex, frame + kOcclusion, "occlusion");
  smooth_ = make_program(kVertex, frame + kSmooth, "smooth occlusion");
}

const GlProgram& ScreenPass::compose(const PictureSettings& settings, bool transparent) {
  const std::size_t number =
      (settings.occlusion ? 1u : 0u) + (settings.edges ? 2u : 0u) + (transparent ? 4u : 0u);
  GlProgram& program = compose_[number];
  // A software driver executes both branches of a condition, so unused code is left out.
  if (!program)
    program = make_program(
        kVertex,
        sampled(samples_) +
            fmt::format("#define OCCLUSION {}\n#define EDGES {}\n#define TRANSPARENT {}\n",
                        settings.occlusion, settings.edges ? 1 : 0, transparent ? 1 : 0) +
            kFrameGlsl + kCompose,
        "the picture");
  return program;
}

void ScreenPass::draw(const GlProgram& program, const GlFramebuffer& target) {
  glBindFramebuffer(GL_FRAMEBUFFER, target.get());
  glUseProgram(program.get());
  glBindVertexArray(no_attributes_.get());
  glDrawArrays(GL_TRIANGLES, 0, 3);
}

std::vector<ScreenPass::Step> ScreenPass::steps(const PictureSettings& settings) {
  if (!settings.occlusion) return {Step::nearest, Step::compose};
  return {Step::nearest, Step::occlusion, Step::smooth_rows, Step::smooth_columns, Step::compose};
}

/// Binds the inputs of the last step.
void ScreenPass::bind_samples(const ScreenPicture& picture) {
  bind(0, picture.targets.colour);
  bind(1, picture.targets.depth);
  if (picture.transparent) {
    bind(2, picture.targets.sum);
    bind(3, picture.targets.transmittance);
  }
  bind(4, picture.result.near_depth);
  bind(5, picture.result.near_normal);
  bind(6, picture.targets.openness);
}

void ScreenPass::run(Step step, const ScreenPicture& picture, PictureRows rows) {
  const PictureTargets& targets = picture.targets;
  glEnable(GL_SCISSOR_TEST);
  glScissor(0, rows.first, targets.width, rows.count);
  switch (step) {
    case Step::nearest:
      bind(0, targets.normal);
      bind(1, targets.depth);
      if (targets.ids) bind(2, targets.id);
      glProgramUniform1i(nearest_.get(), 0, targets.ids);
      draw(nearest_, picture.result.nearest);
      break;
    case Step::occlusion:
      bind(0, picture.result.near_depth);
      bind(1, picture.result.near_normal);
      draw(occlusion_, targets.openness_target);
      break;
    case Step::smooth_rows:
      bind(0, picture.result.near_depth);
      bind(1, targets.openness);
      glProgramUniform2i(smooth_.get(), 0, 1, 0);
      draw(smooth_, targets.openness_rows_target);
      break;
    case Step::smooth_columns:
      bind(0, picture.result.near_depth);
      bind(1, targets.openness_rows);
      glProgramUniform2i(smooth_.get(), 0, 0, 1);
      draw(smooth_, targets.openness_target);
      break;
    case Step::compose:
      bind_samples(picture);
      draw(compose(picture.settings, picture.transparent), picture.result.picture_target);
      break;
  }
  glDisable(GL_SCISSOR_TEST);
  check_gl("making the picture");
}

}  // namespace isobrick
