#include "viewer/app/scene_renderer.h"

#include <algorithm>
#include <chrono>
#include <limits>
#include <utility>

#include <epoxy/gl.h>

#include "core/stopwatch.h"
#include "viewer/render/gl_context.h"

namespace isobrick::inline v0 {
namespace {

using Clock = std::chrono::steady_clock;

/// Seconds between frames while meshes arrive and nothing else changes: a frame keeps the device
/// from making meshes.
constexpr double kRefiningSeconds = 0.04;
/// The same as a multiple of the last frame's time: frames that are soon out of date take at most a
/// third of the time. In software a frame may take seconds.
constexpr double kRefiningPause = 2;
constexpr double kWaitSeconds = 0.05;

/// `software`: other threads draw, too, so mesh threads keep their priority.
StreamOptions stream_options(const PictureBudgets& budgets, std::function<void()> on_change,
                             bool software) {
  StreamOptions options;
  options.inside = budgets.inside;
  options.threads = budgets.threads;
  options.mesh_bytes = budgets.memory / 2;
  options.brick_bytes = budgets.memory - options.mesh_bytes - SliceViews::memory(budgets);
  options.device_bytes = DeviceMeshes::cache_bytes(budgets.device_mesh_memory());
  options.on_change = std::move(on_change);
  options.lower_thread_priority = !software;
  return options;
}

/// The finest level of nodes with samples of this stored level, or of the next coarser one that any
/// has.
int finest_node_level(const NodeGrid& grid, int stored) {
  int v = 0;
  while (v < grid.coarsest_stored() && grid.level(v).source < stored) ++v;
  return v;
}

bool same_meshes(const Drawable* a, const Drawable* b) {
  if (a == nullptr || b == nullptr || a == b) return a == b;
  return std::equal(a->nodes.begin(), a->nodes.end(), b->nodes.begin(), b->nodes.end(),
                    [](const NodeDraw& p, const NodeDraw& q) {
                      return p.mesh == q.mesh && p.isovalue == q.isovalue;
                    });
}

}  // namespace

FrameOptions FrameOptions::in_window(const FramePacer& pacer, bool software, bool moving) {
  FrameOptions options{
      .max_triangles = moving ? pacer.max_triangles() : FramePacer::kAllTriangles,
      .thin_triangles = moving ? pacer.thin_triangles() : 0,
      .batch_seconds = software ? kBatchSeconds : std::numeric_limits<double>::infinity(),
      .moving = moving,
      .size_divisor = moving ? pacer.size_divisor() : 1};
  // Intermediate frames need not wait for full quality, either.
  if (pacer.reduces_quality())
    options.quality = moving ? Quality::reduced : Quality::reduced_until_complete;
  return options;
}

SceneRenderer::SceneRenderer(std::shared_ptr<const StoreReader> store,
                             const PictureBudgets& budgets, std::function<void()> on_change,
                             std::shared_ptr<PictureSetup> setup)
    : store_(std::move(store)),
      budgets_(budgets),
      scene_future_(std::async(std::launch::async,
                               [&, software = current_gl_device().software] {
                                 return std::make_unique<Scene>(
                                     store_bricks(store_),
                                     stream_options(budgets_, on_change, software));
                               })),
      setup_(setup ? std::move(setup) : std::make_shared<PictureSetup>(budgets, on_change)),
      uploads_(setup_->pool(), setup_->software() ? MeshUploads::UnusedMeshes::drop
                                                  : MeshUploads::UnusedMeshes::keep),
      slices_(budgets, last_sample(*store_), store_->info().type) {
  scene_ = scene_future_.get();
  device_ = std::make_unique<DeviceMeshes>(scene_->stream(), setup_->device());
  device_->use(budgets.backend);
  renderer().discard();  // the picture of another store
}

SceneRenderer::~SceneRenderer() = default;

void SceneRenderer::update_scene(const Camera& camera, int width, int height,
                                 const ViewSettings& settings, const FrameOptions& options) {
  std::vector<double> isovalues;
  shown_surfaces_.clear();
  for (std::size_t i = 0; i < settings.surfaces.size(); ++i)
    if (settings.surfaces[i].shown) {
      isovalues.push_back(settings.surfaces[i].isovalue);
      shown_surfaces_.push_back(i);
    }
  View view = view_of(camera, width, height, settings.pixel_error);
  view.finest_level = finest_node_level(scene_->tree().grid(), settings.finest_level);
  view.thin_pixel_error = view.pixel_error / options.size_divisor;
  const ClipRegion box = clip_region(settings);
  if (!box.whole()) {
    const Vec3d last = last_sample(*store_);
    view.clip = IndexBox{box.lo * last, box.hi * last};
  }
  view.planes = clip_half_spaces(settings);
  CutBudget budget;
  budget.triangles = std::min(budget.triangles, options.max_triangles);
  budget.thin_triangles = options.thin_triangles;
  // Half of the memory is for meshes that are substituted until the cut is complete.
  const std::uint64_t device_bytes = device_->kernel_lock() != nullptr
                                         ? DeviceMeshes::cache_bytes(device_->allocated_bytes())
                                         : upload_memory();
  budget.mesh_bytes = std::min(device_bytes, budgets_.memory / 2) / 2;
  scene_->update(isovalues, view, budget);
}

void SceneRenderer::upload(const std::shared_ptr<const Drawable>& newest) {
  MeshUploads::Limit limit;
  // The first frame has no limit.
  const auto add = [&](const Drawable& drawable) {
    return uploads_.add(drawable, scene_->origin(), shown_meshes_ == nullptr ? nullptr : &limit);
  };
  if (shown_meshes_ != nullptr) uploads_.keep(*shown_meshes_);
  // The upload that has begun is finished first, or none would be while newer meshes keep arriving.
  // But a complete surface has no newer one.
  const bool last =
      next_meshes_ != nullptr && newest->complete && next_meshes_->isovalues == newest->isovalues;
  if (next_meshes_ != nullptr && next_meshes_ != shown_meshes_ && !last) {
    if (!add(*next_meshes_)) return;
    shown_meshes_ = next_meshes_;
  }
  next_meshes_ = newest;
  if (add(*next_meshes_)) shown_meshes_ = next_meshes_;
}

/// Whether new meshes can wait, because more will arrive.
bool SceneRenderer::can_wait(const Drawable& newest) const {
  if (shown_meshes_ == nullptr || !shown_meshes_->covers || newest.complete ||
      shown_meshes_->isovalues != newest.isovalues)
    return false;
  const double pause = kRefiningPause * frame_seconds_;
  return std::chrono::duration<double>(Clock::now() - finish_time_).count() <
         (device_->kernel_lock() != nullptr ? std::max(pause, kRefiningSeconds) : pause);
}

bool SceneRenderer::may_reduce_quality(const FrameRequest& request) const {
  if (request.options.quality != FrameOptions::Quality::reduced_until_complete)
    return request.options.quality == FrameOptions::Quality::reduced;
  if (setup_->software()) return !state_.complete;
  // With a full budget the newest may stay incomplete.
  return shown_meshes_ != request.newest || !(request.idle || request.newest->complete);
}

void SceneRenderer::drop_unused() {
  if (shown_meshes_ != nullptr) uploads_.keep(*shown_meshes_);
  uploads_.drop(upload_memory());
  state_.device_bytes = uploads_.bytes() + device_->allocated_bytes() + slices_.bytes();
}

/// Uploads, slices and the device's own meshes share the device memory.
std::uint64_t SceneRenderer::upload_memory() const {
  const std::uint64_t others = device_->reserved_bytes() + slices_.bytes();
  return budgets_.device_memory - std::min(others, budgets_.device_memory);
}

/// Whether an unfinished frame is still worth finishing.
bool SceneRenderer::is_still_needed(const PendingFrame& pending,
                                    const FrameRequest& request) const {
  const FrameKey& key = pending.frame.key;
  // A frame in full quality also serves as a reduced one, and a reduced one comes first.
  const bool same_view = key == request.key || key == request.reduced_key;
  if (same_view && pending.isovalues == scene_->isovalues()) return true;
  return pending.state.moving && request.options.moving &&
         2 * request.newest->triangles >= pending.state.triangles;
}

/// Whether the next frame would show no more than the last one.
bool SceneRenderer::has_nothing_new(const ShownFrame& next, const FrameRequest& request) const {
  if (shown_frame_.key != next.key && shown_frame_.key != request.key) return false;
  if (!shown_frame_.stale && shown_frame_.slices == next.slices &&
      same_meshes(shown_frame_.meshes.get(), next.meshes.get()))
    return true;
  // A frame of this isovalue was dropped because another one is expected.
  return !request.idle && shown_frame_.stale && shown_frame_.slices == next.slices &&
         shown_frame_.isovalues == next.isovalues && next.isovalues != scene_->isovalues();
}

/// Chooses the next frame, unless it would show nothing new.
void SceneRenderer::choose_frame(const FrameRequest& request) {
  Stopwatch watch;
  const bool reduced_is_enough = request.options.quality != FrameOptions::Quality::full &&
                                 shown_frame_.key == request.reduced_key;
  const bool other_view = shown_frame_.key != request.key && !reduced_is_enough;
  const bool enough = imported_block_ && shown_meshes_ != nullptr;
  if (!enough && (other_view || request.idle || !can_wait(*request.newest))) upload(request.newest);
  times_.upload = watch.lap();
  slices_.update(scene_->stream(), request.settings);
  times_.slices = watch.lap();
  const bool reduced = may_reduce_quality(request);
  ShownFrame next{.key = reduced ? request.reduced_key : request.key,
                  .meshes = shown_meshes_,
                  .slices = slices_.samples(),
                  .isovalues = {}};
  if (shown_meshes_ != nullptr) next.isovalues = shown_meshes_->isovalues;
  // Pointer motion over panels must not cause a frame, nor a cut without new meshes.
  if (has_nothing_new(next, request)) return;
  if (shown_frame_.slices != next.slices ||
      !same_meshes(shown_frame_.meshes.get(), shown_meshes_.get())) {
    shown_frame_.stale = true;
    shown_frame_.meshes.reset();
    shown_frame_.slices = next.slices;
  }
  pending_.emplace(
      PendingFrame{.frame = std::move(next), .state = {}, .isovalues = scene_->isovalues()});
  pending_->state.moving = request.options.moving;
  pending_->state.reduced_quality = reduced;
}

void SceneRenderer::draw(const Camera& camera, int width, int height, const ViewSettings& settings,
                         const FrameOptions& options) {
  try {
    draw_frame(camera, width, height, settings, options);
  } catch (...) {
    glFinish();
    if (pending_) drop_frame();
    shown_frame_ = {};  // the picture may be incomplete
    has_new_frame_ = imported_block_ = false;
    state_.drawing = state_.needs_draw = state_.complete = false;
    state_.drawn_fraction = 0;
    throw;
  }
}

void SceneRenderer::draw_frame(const Camera& camera, int width, int height,
                               const ViewSettings& settings, const FrameOptions& options) {
  uploads_.begin_use();
  has_new_frame_ = false;
  Stopwatch watch;
  // Until the requested surface is shown, only every second call imports memory; the others show
  // new meshes.
  imported_block_ = !pending_ && (state_.covers || !imported_block_) && device_->update();
  times_ = {.device = watch.lap()};
  update_scene(camera, width, height, settings, options);
  times_.scene = watch.lap();
  const bool idle = scene_->idle();  // read first: then `newest` is complete
  FrameKey key{camera, width, height, settings};
  for (SurfaceSettings& surface : key.settings.surfaces) surface.isovalue = 0;
  FrameKey reduced_key = key;
  reduced_key.settings.occlusion = reduced_key.settings.multisample = false;
  const FrameRequest request{.camera = camera,
                             .width = width,
                             .height = height,
                             .settings = settings,
                             .options = options,
                             .key = std::move(key),
                             .reduced_key = std::move(reduced_key),
                             .idle = idle,
                             .newest = scene_->drawable()};
  times_.drawable = watch.lap();
  if (pending_ && !is_still_needed(*pending_, request)) drop_frame();
  const bool continues = pending_.has_value();
  if (!continues) choose_frame(request);
  if (pending_) {
    watch.lap();
    // A device switches slowly between two contexts; using them one after the other is faster for
    // both.
    const TicketGuard guard(device_->kernel_lock());
    times_.lock = watch.lap();
    if (!continues) begin_frame(request);
    draw_batch(request.options.batch_seconds);
  }
  watch.lap();
  drop_unused();
  update_state(request);
  times_.tidy = watch.lap();
}

void SceneRenderer::update_state(const FrameRequest& request) {
  state_.drawing = pending_.has_value();
  state_.drawn_fraction = pending_ && pending_->total_work > 0
                              ? 1 - static_cast<double>(renderer().work_left()) /
                                        static_cast<double>(pending_->total_work)
                              : 0;
  state_.reduced_quality = shown_frame_.key != request.key;
  // A preview in full quality is not drawn again.
  if (!pending_ && !request.options.moving && !state_.reduced_quality) state_.moving = false;
  state_.limited = scene_->cut().limited_by_budget;
  state_.thin_over_budget = scene_->cut().triangles > request.options.max_triangles;
  state_.limited_by_budget =
      state_.limited && request.options.max_triangles == FramePacer::kAllTriangles;
  state_.covers = shown_meshes_ != nullptr && shown_meshes_->covers &&
                  shown_meshes_->isovalues == scene_->isovalues();
  state_.needs_draw = imported_block_ || device_->has_work();
  state_.complete = !request.options.moving && !pending_ && shown_meshes_ != nullptr &&
                    scene_->is_newest(*shown_meshes_) &&
                    (shown_meshes_->complete || scene_->idle());
}

void SceneRenderer::draw_complete(const Camera& camera, int width, int height,
                                  const ViewSettings& settings, const std::function<void()>& wait) {
  const FrameOptions options{.batch_seconds = kBatchSeconds, .in_order = true};
  for (;;) {
    draw(camera, width, height, settings, options);
    // New meshes change the cut's estimates, so it is chosen once more.
    if (state_.complete) {
      draw(camera, width, height, settings, options);
      if (state_.complete) return;
    }
    wait();
    if (!state_.drawing && !state_.needs_draw) scene_->stream().wait_idle(kWaitSeconds);
  }
}

}  // namespace isobrick
