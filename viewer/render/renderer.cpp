#include "viewer/render/renderer.h"

#include <epoxy/gl.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <limits>
#include <utility>

#include <isobrick/error.h>
#include "core/vectors.h"
#include "viewer/render/frame.h"
#include "viewer/render/gl_context.h"
#include "viewer/render/picture_targets.h"
#include "viewer/render/picture_work.h"

namespace isobrick::inline v0 {
namespace {

/// Depth as a world length, from a word of PictureResult::front.
float depth_of_front(const Camera& camera, std::uint32_t word) {
  const auto stored = std::bit_cast<float>((word & ~0xffu) |
                                           0x80u);  // middle of the range that the lost bits leave
  const double near = camera.near_depth(), far = camera.far_depth();
  return static_cast<float>(camera.orthographic ? far - stored * (far - near) : near / stored);
}

/// Measured with Mesa's llvmpipe: 66 MiB of libraries, 12 of shaders, about 12 of triangles.
/// Shaders that its cache lacks take 8 MiB more; some runs take 26 MiB more than most while other
/// processes draw.
constexpr std::uint64_t kLibraries = std::uint64_t{96} << 20, kOfRenderer = std::uint64_t{30} << 20;

int samples_of(const PictureSettings& settings) { return settings.multisample ? kSamples : 1; }

}  // namespace

struct Renderer::State {
  State()
      : device(current_gl_device()),
        frame_buffer(make_stream_buffer()),
        overlay_frame_buffer(make_stream_buffer()) {
    glGetIntegerv(GL_MAX_TEXTURE_SIZE, &largest_edge);
    check_gl("the limits of the device");
  }

  void start(const Camera& new_camera, int width, int height, const PictureSettings& new_settings);
  void choose_targets(int width, int height);
  void clear();
  void clear_transparent();
  void bind_frame() { glBindBufferBase(GL_UNIFORM_BUFFER, 0, frame_buffer.get()); }
  /// Binds the targets for meshes and slices.
  void bind_target(const DrawSwitches& switches, bool blended);
  bool draw_surfaces(const DrawSwitches& switches, bool blended, std::uint64_t& work);
  void choose_result(bool at_once);
  bool advance(std::uint64_t max_work);
  void draw_deferred_overlays(unsigned framebuffer, int width, int height, int left);

  GlDevice device;
  int largest_edge = 0;
  PicturePasses passes;
  // One for each sampling mode: switching during motion costs nothing.
  std::array<std::optional<ScreenPass>, 2> screens;
  std::array<std::optional<PictureTargets>, 2> all_targets;
  ScreenPass* screen = nullptr;       ///< of the present picture
  PictureTargets* targets = nullptr;  ///< of the present picture
  std::optional<PictureResult> finished,
      next;  ///< the finished picture; the result of the present one
  Camera finished_camera;
  PictureSettings finished_settings;
  Overlays deferred_overlays;  ///< overlays that copy_to() adds to the finished picture

  Camera camera;
  PictureSettings settings;
  FrameBlock frame{};
  Overlays overlays;
  GlBuffer frame_buffer, overlay_frame_buffer;
  PictureWork work;
  bool any_transparent = false;  ///< in the present picture
};

void Renderer::State::start(const Camera& new_camera, int width, int height,
                            const PictureSettings& new_settings) {
  if (width < 1 || height < 1 || width > largest_edge || height > largest_edge)
    throw UsageError(fmt::format("a picture of {} x {} pixels: {} draws 1 to {} along an edge",
                                 width, height, device.renderer, largest_edge));
  const std::size_t planes = new_settings.planes.size() + (new_settings.region ? 6 : 0);
  if (planes > kMaxHalfSpaces)
    throw UsageError(
        fmt::format("{} clipping planes, of which a region is 6: a picture can have {}", planes,
                    kMaxHalfSpaces));
  camera = new_camera;
  settings = new_settings;
  frame = make_frame(camera, width, height, settings);
  passes.meshes.start(frame.counts.x > 0);
  passes.slices.clear();
  overlays = {};
  any_transparent = false;
  choose_targets(width, height);
  frame.samples_x = targets->samples_x;
  frame.samples_y = targets->samples_y;
  work.start(*targets, settings);
  fill_buffer(frame_buffer, std::as_bytes(std::span(&frame, 1)));
  clear();
}

void Renderer::State::choose_targets(int width, int height) {
  const int samples = samples_of(settings);
  const std::size_t mode = settings.multisample ? 1 : 0;
  if (!screens[mode]) screens[mode].emplace(samples);
  screen = &*screens[mode];
  targets = nullptr;
  // Targets of another size are freed first, to save memory.
  for (std::optional<PictureTargets>& other : all_targets)
    if (other &&
        (other->width != width || other->height != height || other->ids != settings.picking))
      other.reset();
  if (!all_targets[mode]) all_targets[mode].emplace(width, height, samples, settings.picking);
  targets = &*all_targets[mode];
}

/// Clears only the depth: nothing reads the rest where nothing is drawn.
void Renderer::State::clear() {
  const DrawSwitches switches(frame);
  const unsigned target = targets->opaque.get();
  const std::array<GLenum, 3> rest{GL_COLOR_ATTACHMENT0, GL_COLOR_ATTACHMENT1,
                                   GL_COLOR_ATTACHMENT2};
  glInvalidateNamedFramebufferData(target, targets->ids ? 3 : 2, rest.data());
  const float far = 0;
  glClearNamedFramebufferfv(target, GL_DEPTH, 0, &far);
  check_gl("clearing the picture");
}

void Renderer::State::clear_transparent() {
  if (std::exchange(any_transparent, true)) return;
  targets->add_transparent();
  const std::array<float, 4> nothing{}, all{1, 1, 1, 1};
  glClearNamedFramebufferfv(targets->transparent.get(), GL_COLOR, 0, nothing.data());
  glClearNamedFramebufferfv(targets->transparent.get(), GL_COLOR, 1, all.data());
  if (!targets->ids) return;
  glMemoryBarrier(GL_TEXTURE_UPDATE_BARRIER_BIT);  // after a dropped picture
  glClearTexImage(targets->front.get(), 0, GL_RED_INTEGER, GL_UNSIGNED_INT, nullptr);
}

void Renderer::State::bind_target(const DrawSwitches& switches, bool blended) {
  if (blended) clear_transparent();
  glBindFramebuffer(GL_FRAMEBUFFER, blended ? targets->transparent.get() : targets->opaque.get());
  if (blended && targets->ids)
    glBindImageTexture(0, targets->front.get(), 0, GL_FALSE, 0, GL_READ_WRITE, GL_R32UI);
  switches.meshes(true, blended);
}

bool Renderer::State::draw_surfaces(const DrawSwitches& switches, bool blended,
                                    std::uint64_t& max_work) {
  if (!work.any_surfaces(passes, blended)) return true;
  bind_target(switches, blended);
  return work.draw_surfaces(passes, camera.eye, blended, max_work);
}

/// `at_once`: the picture is finished in this call, so that it may reuse the memory of the previous
/// one.
void Renderer::State::choose_result(bool at_once) {
  const auto keep_fitting = [&](std::optional<PictureResult>& result) {
    if (result && !result->fits(targets->width, targets->height, targets->ids)) result.reset();
  };
  keep_fitting(next);
  if (at_once && !next) {
    next = std::exchange(finished, std::nullopt);
    keep_fitting(next);
  }
  if (!next) next.emplace(targets->width, targets->height, targets->ids);
}

/// Returns whether the picture is finished.
bool Renderer::State::advance(std::uint64_t max_work) {
  const bool at_once = max_work >= work.remaining();
  const DrawSwitches switches(frame);
  bind_frame();
  if (!draw_surfaces(switches, false, max_work) || !draw_surfaces(switches, true, max_work))
    return false;
  switches.meshes(false, false);
  choose_result(at_once);
  if (!work.run_steps(*screen, {*targets, *next, settings, any_transparent}, max_work))
    return false;
  next->has_front = false;
  if (any_transparent && targets->ids) next->take_front(targets->front);
  deferred_overlays = {};
  overlays.scale = settings.overlay_scale;
  if (settings.defer_overlays)
    deferred_overlays = std::move(overlays);
  else
    passes.overlays.run(overlays, camera, next->picture_target.get(), next->width, next->height,
                        next->near_depth);
  std::swap(finished, next);
  finished_camera = camera;
  finished_settings = settings;
  return true;
}

void Renderer::State::draw_deferred_overlays(unsigned framebuffer, int width, int height,
                                             int left) {
  if (deferred_overlays.empty() || width < 1 || height < 1) return;
  const FrameBlock block = make_frame(finished_camera, width, height, finished_settings);
  const DrawSwitches switches(block);
  fill_buffer(overlay_frame_buffer, std::as_bytes(std::span(&block, 1)));
  glBindBufferBase(GL_UNIFORM_BUFFER, 0, overlay_frame_buffer.get());
  passes.overlays.run(deferred_overlays, finished_camera, framebuffer, width, height,
                      finished->near_depth, left);
}

Renderer::Renderer() : state_(std::make_unique<State>()) {}
Renderer::~Renderer() = default;

std::uint64_t Renderer::memory(int width, int height, const PictureSettings& settings,
                               bool transparent) {
  return PictureTargets::bytes(width, height, samples_of(settings), settings.picking, transparent);
}

std::uint64_t Renderer::driver_memory(int renderers) {
  return kLibraries + static_cast<std::uint64_t>(renderers) * kOfRenderer;
}

void Renderer::begin(const Camera& camera, int width, int height, const PictureSettings& settings) {
  state_->start(camera, width, height, settings);
}

void Renderer::draw(const PooledMesh& mesh, const MeshStyle& style) {
  if (mesh.empty() || style.opacity <= 0) return;
  state_->work.meshes(style.opacity < 1).add(mesh, style);
}

void Renderer::draw(const MeshChunk& mesh, const MeshStyle& style, Vec3d origin) {
  if (style.opacity <= 0) return;
  const bool blended = style.opacity < 1;
  const DrawSwitches switches(state_->frame);
  state_->bind_frame();
  state_->bind_target(switches, blended);
  state_->passes.meshes.draw(mesh, style, origin, state_->camera.eye, blended);
}

void Renderer::draw(const SliceImage& slice) {
  if (slice.opacity > 0) state_->passes.slices.add(slice);
}

void Renderer::draw_lines(std::span<const WorldLine> lines, Vec3f colour, float line_width) {
  for (const WorldLine& line : lines) state_->overlays.lines.push_back({line, colour, line_width});
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
      state_->overlays.lines.push_back({line, colour, line_width});
    }
}

void Renderer::draw_axes() { state_->overlays.axes = true; }
void Renderer::draw_scale_bar(const std::string& unit, double unit_length) {
  state_->overlays.scale_bar = {unit, unit_length};
}

void Renderer::end() { state_->advance(std::numeric_limits<std::uint64_t>::max()); }
bool Renderer::advance(std::uint64_t work) { return state_->advance(work); }
std::uint64_t Renderer::work_left() const { return state_->work.remaining(); }

void Renderer::discard() {
  if (state_->finished) state_->next = std::exchange(state_->finished, std::nullopt);
}
bool Renderer::has_picture() const { return state_->finished.has_value(); }

void Renderer::prepare(const PictureSettings& settings, int width, int height) {
  const std::array<Vec3f, 3> corners{Vec3f{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  const std::array<Triangle, 1> triangle{Triangle{0, 1, 2}};
  MeshChunk mesh;
  mesh.positions = corners;
  mesh.normals = corners;
  mesh.triangles = triangle;
  PictureSettings whole = settings, clipped = settings;
  whole.planes.clear();
  whole.region.reset();
  clipped.planes = {{{1, 0, 0}, 0}};
  for (const PictureSettings& form : {whole, clipped}) {
    begin(Camera({0, 0, 1}, {0, 0, 0}, {0, 1, 0}), width, height, form);
    for (const std::uint16_t mask : {MeshStyle{}.clip_mask, std::uint16_t{0}})
      draw(mesh, {.clip_mask = mask}, {});
    draw_box({0, 0, 0}, {1, 1, 1}, {0, 0, 0});
    draw_axes();
    draw_scale_bar("");
    end();
  }
  discard();
}

int Renderer::width() const { return state_->finished ? state_->finished->width : 0; }
int Renderer::height() const { return state_->finished ? state_->finished->height : 0; }

std::vector<std::uint8_t> Renderer::read_pixels() const {
  if (!has_picture()) return {};
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

unsigned Renderer::texture() const {
  return state_->finished ? state_->finished->picture.get() : 0;
}

void Renderer::copy_to(unsigned framebuffer, int to_width, int to_height, int left) const {
  if (!has_picture()) return;
  const bool same = to_width == width() && to_height == height();
  glBlitNamedFramebuffer(state_->finished->picture_target.get(), framebuffer, 0, 0, width(),
                         height(), left, 0, left + to_width, to_height, GL_COLOR_BUFFER_BIT,
                         same ? GL_NEAREST : GL_LINEAR);
  state_->draw_deferred_overlays(framebuffer, to_width, to_height, left);
  check_gl("showing the picture");
}

std::optional<PickResult> Renderer::pick(int x, int y) const {
  if (x < 0 || y < 0 || x >= width() || y >= height()) return std::nullopt;
  const PictureResult& result = *state_->finished;
  const int from_bottom = height() - 1 - y;
  float depth = 0;
  glGetTextureSubImage(result.near_depth.get(), 0, x, from_bottom, 0, 1, 1, 1, GL_RED, GL_FLOAT,
                       sizeof(depth), &depth);
  PickResult picked;
  if (result.ids)
    glGetTextureSubImage(result.near_id.get(), 0, x, from_bottom, 0, 1, 1, 1, GL_RED_INTEGER,
                         GL_UNSIGNED_INT, sizeof(picked.id), &picked.id);
  const Camera& camera = state_->finished_camera;
  if (result.has_front) {
    std::uint32_t front = 0;
    glGetTextureSubImage(result.front.get(), 0, x, from_bottom, 0, 1, 1, 1, GL_RED_INTEGER,
                         GL_UNSIGNED_INT, sizeof(front), &front);
    const float nearer = front != 0 ? depth_of_front(camera, front) : 0;
    if (nearer > 0 && !(depth > 0 && depth <= nearer)) {
      depth = nearer;
      picked.id = front & 0xff;
    }
  }
  check_gl("reading a pixel");
  if (!(depth > 0)) return std::nullopt;
  const WorldRay ray = camera.ray(x + 0.5, y + 0.5, width(), height());
  // The depth is along the line of sight; the ray may be oblique.
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
