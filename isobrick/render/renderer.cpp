#include "isobrick/render/renderer.h"

#include <epoxy/gl.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <functional>
#include <map>

#include "isobrick/core/error.h"
#include "isobrick/render/frame.h"
#include "isobrick/render/gl_context.h"
#include "isobrick/render/mesh_pass.h"
#include "isobrick/render/overlay_pass.h"
#include "isobrick/render/picture_targets.h"
#include "isobrick/render/screen_pass.h"
#include "isobrick/render/slice_pass.h"
#include "isobrick/render/vectors.h"

namespace isobrick {
namespace {

constexpr int kSamples = 4;

int samples_of(const PictureSettings& settings) { return settings.multisample ? kSamples : 1; }

/// What drawing needs of a context's switches; leaves OpenGL's defaults.
class Switches {
 public:
  explicit Switches(const FrameBlock& frame) {
    glGetIntegerv(GL_VIEWPORT, viewport_.data());
    glViewport(0, 0, static_cast<int>(frame.viewport.x), static_cast<int>(frame.viewport.y));
    glClipControl(GL_LOWER_LEFT, GL_ZERO_TO_ONE);
    glDepthFunc(GL_GREATER);
    glPolygonMode(GL_FRONT_AND_BACK, GL_FILL);
    for (const GLenum off : {GL_BLEND, GL_CULL_FACE, GL_SCISSOR_TEST, GL_STENCIL_TEST,
                             GL_FRAMEBUFFER_SRGB, GL_DEPTH_TEST})
      glDisable(off);
    glColorMask(GL_TRUE, GL_TRUE, GL_TRUE, GL_TRUE);
  }
  ~Switches() {
    meshes(0, false, false);
    glClipControl(GL_LOWER_LEFT, GL_NEGATIVE_ONE_TO_ONE);
    glDepthFunc(GL_LESS);
    glViewport(viewport_[0], viewport_[1], viewport_[2], viewport_[3]);
    glBindFramebuffer(GL_FRAMEBUFFER, 0);
    glUseProgram(0);
    glBindVertexArray(0);
  }
  Switches(const Switches&) = delete;
  Switches& operator=(const Switches&) = delete;

  /// Depth test, clipping by the first `distances` planes, weighted blending.
  void meshes(int distances, bool depth_test, bool blended) const {
    const auto set = [](GLenum what, bool on) { on ? glEnable(what) : glDisable(what); };
    set(GL_DEPTH_TEST, depth_test);
    glDepthMask(!blended);
    for (int i = 0; i < kClipDistances; ++i)
      set(GL_CLIP_DISTANCE0 + static_cast<GLenum>(i), i < distances);
    set(GL_BLEND, blended);
    if (!blended) return;
    glBlendFunci(0, GL_ONE, GL_ONE);
    glBlendFunci(1, GL_ZERO, GL_ONE_MINUS_SRC_COLOR);
  }

 private:
  std::array<int, 4> viewport_{};
};

/// Meshes of the same block stand together.
bool before(const MeshDraw& a, const MeshDraw& b) {
  return a.mesh->place().positions < b.mesh->place().positions;
}

}  // namespace

struct Renderer::State {
  State() : device(current_gl_device()), frame_buffer(make_stream_buffer()) {
    glGetIntegerv(GL_MAX_TEXTURE_SIZE, &largest_edge);
    check_gl("the limits of the device");
  }

  void start(const Camera& new_camera, int width, int height, const PictureSettings& new_settings);
  void choose_targets(int width, int height);
  void clear();
  void clear_transparent();
  void bind_frame() { glBindBufferBase(GL_UNIFORM_BUFFER, 0, frame_buffer.get()); }
  /// Makes ready to draw meshes or slices.
  void bind_target(const Switches& switches, bool blended);
  void draw_blocks(const Switches& switches, std::vector<MeshDraw>& list, bool blended);
  void draw_slices(const Switches& switches, bool blended);
  void finish();

  GlDevice device;
  int largest_edge = 0;
  MeshPass meshes;
  SlicePass slices;
  OverlayPass overlays;
  // One for each way to sample: switching to and fro while something moves costs nothing.
  std::array<std::optional<ScreenPass>, 2> screens;
  std::array<std::optional<PictureTargets>, 2> kept_targets;
  ScreenPass* screen = nullptr;       ///< of this picture
  PictureTargets* targets = nullptr;  ///< likewise

  Camera camera;
  PictureSettings settings;
  FrameBlock frame{};
  GlBuffer frame_buffer;
  std::vector<MeshDraw> opaque, transparent;
  bool any_transparent = false;  ///< in this picture
};

void Renderer::State::start(const Camera& new_camera, int width, int height,
                            const PictureSettings& new_settings) {
  if (width < 1 || height < 1 || width > largest_edge || height > largest_edge)
    throw UsageError(fmt::format("a picture of {} x {} pixels: {} draws 1 to {} along an edge",
                                 width, height, device.renderer, largest_edge));
  const std::size_t planes = new_settings.planes.size() + (new_settings.region ? 6 : 0);
  if (planes > kMostHalfSpaces)
    throw UsageError(
        fmt::format("{} clipping planes, of which a region is 6: a picture can have {}", planes,
                    kMostHalfSpaces));
  camera = new_camera;
  settings = new_settings;
  frame = make_frame(camera, width, height, settings);
  opaque.clear();
  transparent.clear();
  slices.clear();
  overlays.start(camera, width, height);
  any_transparent = false;
  choose_targets(width, height);
  fill_buffer(frame_buffer, std::as_bytes(std::span(&frame, 1)));
  clear();
}

void Renderer::State::choose_targets(int width, int height) {
  const int samples = samples_of(settings);
  const std::size_t way = settings.multisample ? 1 : 0;
  if (!screens[way]) screens[way].emplace(samples);
  screen = &*screens[way];
  targets = nullptr;
  // What has another size goes first, so that it and the new are never there at once.
  for (std::optional<PictureTargets>& kept : kept_targets)
    if (kept && (kept->width != width || kept->height != height || kept->ids != settings.picking))
      kept.reset();
  if (!kept_targets[way]) kept_targets[way].emplace(width, height, samples, settings.picking);
  targets = &*kept_targets[way];
}

void Renderer::State::clear() {
  const Switches switches(frame);
  const std::array<float, 4> nothing{};
  const std::array<unsigned, 4> nobody{};
  const unsigned target = targets->opaque.get();
  glClearNamedFramebufferfv(target, GL_COLOR, 0, nothing.data());
  glClearNamedFramebufferfv(target, GL_COLOR, 1, nothing.data());
  if (targets->ids) glClearNamedFramebufferuiv(target, GL_COLOR, 2, nobody.data());
  glClearNamedFramebufferfv(target, GL_DEPTH, 0, nothing.data());  // 0 is far
  check_gl("clearing the picture");
}

void Renderer::State::clear_transparent() {
  if (std::exchange(any_transparent, true)) return;
  targets->add_transparent();
  const std::array<float, 4> nothing{}, all{1, 1, 1, 1};
  glClearNamedFramebufferfv(targets->transparent.get(), GL_COLOR, 0, nothing.data());
  glClearNamedFramebufferfv(targets->transparent.get(), GL_COLOR, 1, all.data());
}

void Renderer::State::bind_target(const Switches& switches, bool blended) {
  if (blended) clear_transparent();
  glBindFramebuffer(GL_FRAMEBUFFER, blended ? targets->transparent.get() : targets->opaque.get());
  switches.meshes(frame.counts.x, true, blended);
}

void Renderer::State::draw_slices(const Switches& switches, bool blended) {
  if (!slices.any(blended)) return;
  bind_target(switches, blended);
  slices.draw(camera.eye, blended);
}

void Renderer::State::draw_blocks(const Switches& switches, std::vector<MeshDraw>& list,
                                  bool blended) {
  if (list.empty()) return;
  bind_target(switches, blended);
  std::stable_sort(list.begin(), list.end(), before);
  for (auto first = list.begin(); first != list.end();) {
    const auto last = std::upper_bound(first, list.end(), *first, before);
    meshes.draw(std::span(first, last), camera.eye, blended);
    first = last;
  }
}

void Renderer::State::finish() {
  const Switches switches(frame);
  bind_frame();
  draw_blocks(switches, opaque, false);
  draw_slices(switches, false);
  draw_blocks(switches, transparent, true);
  draw_slices(switches, true);
  switches.meshes(0, false, false);
  screen->run(*targets, settings, any_transparent);
  overlays.run(*targets);
}

Renderer::Renderer() : state_(std::make_unique<State>()) {}
Renderer::~Renderer() = default;

std::uint64_t Renderer::memory(int width, int height, const PictureSettings& settings,
                               bool transparent) {
  return PictureTargets::bytes(width, height, samples_of(settings), settings.picking, transparent);
}

void Renderer::begin(const Camera& camera, int width, int height, const PictureSettings& settings) {
  state_->start(camera, width, height, settings);
}

void Renderer::draw(const PooledMesh& mesh, const MeshStyle& style) {
  if (mesh.empty() || style.opacity <= 0) return;
  (style.opacity < 1 ? state_->transparent : state_->opaque).push_back({&mesh, style});
}

void Renderer::draw(const MeshChunk& mesh, const MeshStyle& style, Vec3d origin) {
  if (style.opacity <= 0) return;
  const bool blended = style.opacity < 1;
  const Switches switches(state_->frame);
  state_->bind_frame();
  state_->bind_target(switches, blended);
  state_->meshes.draw(mesh, style, origin, state_->camera.eye, blended);
}

void Renderer::draw(const SliceImage& slice) {
  if (slice.opacity > 0) state_->slices.add(slice);
}

void Renderer::draw_lines(std::span<const WorldLine> lines, Vec3f colour, float line_width) {
  for (const WorldLine& line : lines) state_->overlays.add_line(line, colour, line_width);
}

void Renderer::draw_box(Vec3d lo, Vec3d hi, Vec3f colour, float line_width) {
  for (int axis = 0; axis < 3; ++axis)
    for (int corner = 0; corner < 4; ++corner) {
      const int second = (axis + 1) % 3, third = (axis + 2) % 3;
      WorldLine line{lo, lo};
      if (corner & 1) line.from[second] = hi[second];
      if (corner & 2) line.from[third] = hi[third];
      line.to = line.from;
      line.to[axis] = hi[axis];
      state_->overlays.add_line(line, colour, line_width);
    }
}

void Renderer::draw_axes() { state_->overlays.add_axes(); }
void Renderer::draw_scale_bar(const std::string& unit) { state_->overlays.add_scale_bar(unit); }

void Renderer::end() { state_->finish(); }

void Renderer::prepare(const PictureSettings& settings) {
  constexpr int edge = 16;
  const std::array<Vec3f, 3> corners{Vec3f{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  const std::array<Triangle, 1> triangle{Triangle{0, 1, 2}};
  MeshChunk mesh;
  mesh.positions = corners;
  mesh.normals = corners;
  mesh.triangles = triangle;
  begin(Camera({0, 0, 1}, {0, 0, 0}, {0, 1, 0}), edge, edge, settings);
  draw(mesh, {}, {});
  draw_box({0, 0, 0}, {1, 1, 1}, {0, 0, 0});
  draw_axes();
  draw_scale_bar("");
  end();
}

int Renderer::width() const { return state_->targets ? state_->targets->width : 0; }
int Renderer::height() const { return state_->targets ? state_->targets->height : 0; }

std::vector<std::uint8_t> Renderer::read_pixels() const {
  const std::size_t row = 4 * static_cast<std::size_t>(width());
  const auto rows = static_cast<std::size_t>(height());
  std::vector<std::uint8_t> pixels(row * rows);
  glGetTextureImage(texture(), 0, GL_RGBA, GL_UNSIGNED_BYTE, static_cast<GLsizei>(pixels.size()),
                    pixels.data());
  check_gl("reading the picture");
  for (std::size_t y = 0; y < rows / 2; ++y)
    std::swap_ranges(pixels.data() + y * row, pixels.data() + (y + 1) * row,
                     pixels.data() + (rows - 1 - y) * row);
  return pixels;
}

unsigned Renderer::texture() const { return state_->targets->picture.get(); }

void Renderer::copy_to(unsigned framebuffer, int to_width, int to_height) const {
  const bool same = to_width == width() && to_height == height();
  glBlitNamedFramebuffer(state_->targets->picture_target.get(), framebuffer, 0, 0, width(),
                         height(), 0, 0, to_width, to_height, GL_COLOR_BUFFER_BIT,
                         same ? GL_NEAREST : GL_LINEAR);
  check_gl("showing the picture");
}

std::optional<Picked> Renderer::pick(int x, int y) const {
  if (x < 0 || y < 0 || x >= width() || y >= height()) return std::nullopt;
  const PictureTargets& targets = *state_->targets;
  const int from_bottom = height() - 1 - y;
  float depth = 0;
  glGetTextureSubImage(targets.near_depth.get(), 0, x, from_bottom, 0, 1, 1, 1, GL_RED, GL_FLOAT,
                       sizeof(depth), &depth);
  Picked picked;
  if (targets.ids)
    glGetTextureSubImage(targets.near_id.get(), 0, x, from_bottom, 0, 1, 1, 1, GL_RED_INTEGER,
                         GL_UNSIGNED_INT, sizeof(picked.id), &picked.id);
  check_gl("reading a pixel");
  if (!(depth > 0)) return std::nullopt;
  const Camera& camera = state_->camera;
  const WorldRay ray = camera.ray(x + 0.5, y + 0.5, width(), height());
  // The depth is along the line of sight, the ray may slant.
  picked.position = ray.origin + ray.direction * (depth / -dot(ray.direction, camera.back));
  return picked;
}

std::vector<std::uint8_t> without_alpha(std::vector<std::uint8_t> rgba) {
  const std::size_t pixels = rgba.size() / 4;
  for (std::size_t i = 0; i < pixels; ++i) std::memmove(&rgba[3 * i], &rgba[4 * i], 3);
  rgba.resize(3 * pixels);
  return rgba;
}

}  // namespace isobrick
