#include "viewer/render/mesh_pass.h"

#include <epoxy/gl.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <glm/vec4.hpp>
#include <limits>
#include <numeric>

#include "core/vectors.h"
#include "viewer/render/frame.h"
#include "viewer/render/gl_context.h"

namespace isobrick::inline v0 {
namespace {

/// Parameters of one mesh; std430.
struct DrawParameters {
  glm::vec4 offset;  ///< from the eye; w: has normals
  glm::vec4 colour;  ///< linear; alpha: opacity
  glm::vec4 inside;
  glm::uvec4 id;  ///< y: clip mask
};

/// See MeshPass::max_triangles().
constexpr std::uint64_t kSoftwareTriangles = std::uint64_t{1} << 14;

/// The command layout of glMultiDrawElementsIndirect.
struct Command {
  std::uint32_t count, instances, first_index;
  std::int32_t base_vertex;
  std::uint32_t base_instance;
};

const char* const kParametersGlsl = R"(
struct DrawParameters { vec4 offset, colour, inside; uvec4 id; };
layout(std430, binding = 0) readonly buffer Parameters { DrawParameters parameters[]; };
)";

const char* const kVertex = R"(
layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;
layout(location = 2) in uint number;
#if COLOURED
layout(location = 3) in vec3 vertex_colour;
centroid out vec3 surface_colour;
#endif
centroid out vec3 world_normal;
#if FRONT
// Centroid: within the triangle even if the pixel's centre is beside it.
noperspective centroid out float stored_depth;
#endif
#if SOFTWARE
// Fragments get the parameters here and not from the buffer: when Mesa's llvmpipe draws them, the
// buffer may already hold the next mesh's.
flat out vec4 outer_colour, inner_colour;
flat out uvec3 mesh;  // id, clip mask, has normals
#else
flat out uint draw_index;
#endif

void main() {
  place(position + parameters[number].offset.xyz);
  world_normal = normal;
#if COLOURED
  surface_colour = vertex_colour;
#endif
#if FRONT
  stored_depth = gl_Position.z / gl_Position.w;
#endif
#if SOFTWARE
  outer_colour = parameters[number].colour;
  inner_colour = parameters[number].inside;
  mesh = uvec3(parameters[number].id.xy, parameters[number].offset.w > 0.5 ? 1 : 0);
#else
  draw_index = number;
#endif
}
)";

const char* const kFragment = R"(
centroid in vec3 world_normal;
#if SOFTWARE
flat in vec4 outer_colour, inner_colour;
flat in uvec3 mesh;
#else
flat in uint draw_index;
#define outer_colour parameters[draw_index].colour
#define inner_colour parameters[draw_index].inside
#define mesh uvec3(parameters[draw_index].id.xy, parameters[draw_index].offset.w > 0.5 ? 1 : 0)
#endif

#if COLOURED
centroid in vec3 surface_colour;
vec3 outer() {
  vec3 c = clamp(surface_colour, 0, 1);
  return mix(c / 12.92, pow((c + 0.055) / 1.055, vec3(2.4)), greaterThan(c, vec3(0.04045)));
}
#else
vec3 outer() { return outer_colour.rgb; }
#endif

struct ShadedPoint { vec3 position, normal, eye, light; float slope; };

ShadedPoint shade() {
  ShadedPoint s;
  s.position = here();
  vec3 facet = cross(dFdx(s.position), dFdy(s.position));
  s.slope = fwidth(gl_FragCoord.z);
  clip(mesh.y);  // after all derivatives
  s.eye = towards_eye(s.position);
  facet = dot(facet, facet) > 0 ? normalize(facet) : s.eye;
  if (dot(facet, s.eye) < 0) facet = -facet;
  s.normal = mat3(rotation) * world_normal;
  float size = dot(s.normal, s.normal);
  if (mesh.z == 0u || !(size > 1e-12) || isinf(size))
    s.normal = facet;
  else
    s.normal *= inversesqrt(size);
  // Both sides are lit, whatever the winding.
  if (dot(s.normal, facet) < 0) s.normal = -s.normal;
  float facing = dot(s.normal, s.eye);
  if (facing < 0.02) s.normal = normalize(s.normal + s.eye * (0.02 - facing));
  bool back = CLIPS != 0 && !gl_FrontFacing;
  s.light = lit(s.normal, s.eye, back ? inner_colour.rgb : outer());
  return s;
}
)";

const char* const kOpaque = R"(
layout(location = 0) out vec4 colour;
layout(location = 1) out vec2 normal;
layout(location = 2) out uint id;

void main() {
  ShadedPoint s = shade();
  colour = vec4(min(s.light, vec3(4)), 1);
  normal = s.normal.xy;
  id = mesh.x;
}
)";

const char* const kTransparent = R"(
// Fragments behind opaque meshes do not count as front.
layout(early_fragment_tests) in;
layout(binding = 0, r32ui) uniform uimage2D front;
noperspective centroid in float stored_depth;
layout(location = 0) out vec4 sum;
layout(location = 1) out float hidden;

void main() {
  ShadedPoint s = shade();
  // The depth at the centroid. It is limited to the slope within a pixel, since a triangle that
  // passes the eye has no depth in between.
  float within = clamp(stored_depth, gl_FragCoord.z - s.slope, gl_FragCoord.z + s.slope);
  if (counts.y != 0) {
    bool whole = gl_SampleMaskIn[0] == counts.z;
    float depth = whole ? gl_FragCoord.z : clamp(within, 0.0, 1.0);
    // Larger is nearer; the low bits of the depth make room for the id.
    imageAtomicMax(front, ivec2(gl_FragCoord.xy),
                   floatBitsToUint(depth) & 0xffffff00u | mesh.x & 0xffu);
  }
  // Slanting rays pass through more of it.
  float facing = max(dot(s.normal, s.eye), 0.12);
  float alpha = 1 - pow(1 - outer_colour.a, 1 / facing);
  sum = vec4(min(s.light, vec3(2)), 1) * alpha * weight_at(-s.position.z);
  hidden = alpha;
}
)";

glm::vec4 offset_of(Vec3d origin, Vec3d eye, bool normals) {
  const Vec3f from_eye = to_float(origin - eye);
  return {from_eye.x, from_eye.y, from_eye.z, normals ? 1.0f : 0.0f};
}

/// All parameters but the offset.
DrawParameters parameters_of(const MeshStyle& style) {
  const Vec3f c = style.colour;
  const Vec3f darker{0.30f + 0.42f * c.x, 0.24f + 0.38f * c.y, 0.22f + 0.34f * c.z};
  const float opacity = std::clamp(style.opacity, 0.0f, 1.0f);
  return {{},
          to_linear(c, opacity),
          to_linear(style.inside.value_or(darker), opacity),
          {style.id, style.clip_mask, 0, 0}};
}

/// An offset into the bound buffer, which OpenGL takes as a pointer.
const void* buffer_offset(std::size_t bytes) {
  return reinterpret_cast<const void*>(bytes);  // NOLINT(performance-no-int-to-ptr)
}

}  // namespace

MeshPass::Programs::Programs(bool clips, bool picture_clips, bool software, bool coloured) {
  const std::string frame =
      fmt::format("#define CLIPS {}\n#define SOFTWARE {}\n#define COLOURED {}\n",
                  picture_clips ? 1 : 0, software ? 1 : 0, coloured ? 1 : 0) +
      kFrameGlsl;
  const std::string vertex = kPlaceGlsl + std::string(kParametersGlsl) + kVertex,
                    fragment = frame + (software ? "" : kParametersGlsl) + fragment_glsl(clips) +
                               kLightGlsl + kFragment;
  opaque = make_program("#define FRONT 0\n" + frame + vertex, fragment + kOpaque, "meshes");
  transparent = make_program("#define FRONT 1\n" + frame + vertex, fragment + kTransparent,
                             "transparent meshes");
}

MeshPass::MeshPass()
    : software_(current_gl_device().software),
      vertices_(make_vertex_array()),
      parameters_(make_stream_buffer()),
      numbers_(make_stream_buffer()),
      commands_(make_stream_buffer()),
      positions_(make_stream_buffer()),
      normals_(make_stream_buffer()),
      colours_(make_stream_buffer()),
      triangles_(make_stream_buffer()) {
  const unsigned array = vertices_.get();
  for (unsigned attribute : {0u, 1u}) {
    glEnableVertexArrayAttrib(array, attribute);
    glVertexArrayAttribFormat(array, attribute, 3, GL_FLOAT, GL_FALSE, 0);
    glVertexArrayAttribBinding(array, attribute, attribute);
  }
  glEnableVertexArrayAttrib(array, 2);
  glVertexArrayAttribIFormat(array, 2, 1, GL_UNSIGNED_INT, 0);
  glVertexArrayAttribBinding(array, 2, 2);
  glVertexArrayBindingDivisor(array, 2, 1);
  glVertexArrayAttribFormat(array, 3, 3, GL_UNSIGNED_BYTE, GL_TRUE, 0);
  glVertexArrayAttribBinding(array, 3, 3);
  check_gl("the attributes of meshes");
}

void MeshPass::fill_numbers(std::size_t count) {
  if (count > number_count_) {
    std::vector<std::uint32_t> numbers(std::max<std::size_t>(2 * count, 1024));
    std::iota(numbers.begin(), numbers.end(), 0u);
    fill_buffer(numbers_, std::as_bytes(std::span(numbers)));
    number_count_ = numbers.size();
  }
  glVertexArrayVertexBuffer(vertices_.get(), 2, numbers_.get(), 0, sizeof(std::uint32_t));
}

void MeshPass::bind(bool clips, bool transparent, bool coloured) {
  clips &= clips_;
  const std::size_t colours = coloured ? 1 : 0;
  std::optional<Programs>& programs =
      clips_ ? programs_[colours][clips ? 1 : 0] : whole_programs_[colours];
  if (!programs) programs.emplace(clips, clips_, software_, coloured);
  glUseProgram((transparent ? programs->transparent : programs->opaque).get());
  glBindVertexArray(vertices_.get());
  glBindBufferBase(GL_SHADER_STORAGE_BUFFER, 0, parameters_.get());
}

void MeshPass::bind_block(const MeshPlace& place) {
  glVertexArrayVertexBuffer(vertices_.get(), 0, place.positions, 0, sizeof(Vec3f));
  glVertexArrayVertexBuffer(vertices_.get(), 1, place.normals, 0, sizeof(Vec3f));
  glVertexArrayElementBuffer(vertices_.get(), place.triangles);
}

std::uint64_t MeshPass::max_triangles() const {
  return software_ ? kSoftwareTriangles : std::numeric_limits<std::uint64_t>::max();
}

void MeshPass::wait_for_previous_call() {
  GlFence fence = GlFence::insert();
  if (last_call_) last_call_->wait();
  last_call_ = std::move(fence);
}

void MeshPass::draw(std::span<const MeshDraw> meshes, Vec3d eye, bool transparent) {
  if (meshes.empty()) return;
  std::vector<DrawParameters> parameters;
  std::vector<Command> commands;
  parameters.reserve(meshes.size());
  commands.reserve(meshes.size());
  const MeshStyle* before = nullptr;
  for (const MeshDraw& draw : meshes) {
    const MeshPlace& place = draw.mesh->place();
    commands.push_back({3 * draw.triangles, 1, 3 * (place.first_triangle + draw.first_triangle),
                        static_cast<std::int32_t>(place.first_vertex),
                        static_cast<std::uint32_t>(parameters.size())});
    const bool again = before != nullptr && draw.style == *before;
    before = &draw.style;
    parameters.push_back(again ? parameters.back() : parameters_of(draw.style));
    parameters.back().offset = offset_of(draw.mesh->origin(), eye, draw.mesh->has_normals());
  }
  fill_buffer(parameters_, std::as_bytes(std::span(parameters)));
  fill_buffer(commands_, std::as_bytes(std::span(commands)));
  fill_numbers(parameters.size());
  glBindBuffer(GL_DRAW_INDIRECT_BUFFER, commands_.get());
  for (std::size_t first = 0, end = 0; first < meshes.size(); first = end) {
    const bool clips = may_be_clipped(meshes[first].style);
    while (end < meshes.size() && meshes[end].block() == meshes[first].block() &&
           may_be_clipped(meshes[end].style) == clips)
      ++end;
    bind(clips, transparent);
    bind_block(meshes[first].mesh->place());
    glMultiDrawElementsIndirect(GL_TRIANGLES, GL_UNSIGNED_INT,
                                buffer_offset(first * sizeof(Command)),
                                static_cast<GLsizei>(end - first), 0);
  }
  glBindBuffer(GL_DRAW_INDIRECT_BUFFER, 0);
  check_gl("drawing meshes");
  // On a device these meshes are in device memory.
  if (software_) wait_for_previous_call();
}

void MeshPass::draw(const MeshChunk& mesh, const MeshStyle& style, Vec3d origin, Vec3d eye,
                    bool transparent) {
  finite_triangles_.clear();
  const std::span<const Triangle> triangles = drawable_triangles(mesh, finite_triangles_);
  if (triangles.empty()) return;
  DrawParameters draw = parameters_of(style);
  draw.offset = offset_of(origin, eye, !mesh.normals.empty());
  fill_buffer(parameters_, std::as_bytes(std::span(&draw, 1)));
  fill_buffer(positions_, std::as_bytes(mesh.positions));
  if (!mesh.normals.empty()) fill_buffer(normals_, std::as_bytes(mesh.normals));
  fill_buffer(triangles_, std::as_bytes(triangles));
  fill_numbers(1);
  const GlBuffer& normals = mesh.normals.empty() ? positions_ : normals_;
  bind_block(
      {.positions = positions_.get(), .normals = normals.get(), .triangles = triangles_.get()});
  const bool coloured = style.vertex_colours && !mesh.colours.empty();
  const unsigned array = vertices_.get();
  if (coloured) {
    fill_buffer(colours_, std::as_bytes(mesh.colours));
    glVertexArrayVertexBuffer(array, 3, colours_.get(), 0, sizeof(VertexColour));
    glEnableVertexArrayAttrib(array, 3);
  }
  bind(may_be_clipped(style), transparent, coloured);
  const auto per_call =
      static_cast<std::size_t>(std::min<std::uint64_t>(max_triangles(), triangles.size()));
  for (std::size_t first = 0; first < triangles.size(); first += per_call) {
    const std::size_t count = std::min(per_call, triangles.size() - first);
    glDrawElements(GL_TRIANGLES, static_cast<GLsizei>(3 * count), GL_UNSIGNED_INT,
                   buffer_offset(first * sizeof(Triangle)));
    wait_for_previous_call();
  }
  if (coloured) glDisableVertexArrayAttrib(array, 3);
  check_gl("drawing a mesh");
}

}  // namespace isobrick
