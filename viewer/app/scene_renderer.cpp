#include "viewer/app/scene_renderer.h"

#include <algorithm>
#include <chrono>
#include <limits>
#include <utility>

#include <epoxy/gl.h>

#include "core/stopwatch.h"
#include "viewer/render/gl_context.h"

namespace isobrick {
namespace {

using Clock = std::chrono::steady_clock;

/// While meshes come in and nothing else changes: seconds between pictures, which would keep the
/// device that draws them from making meshes.
constexpr double kRefiningSeconds = 0.04;
/// The same, in times of the last picture: pictures that are soon out of date, and may take
/// seconds in software, take a third of the time at most.
constexpr double kRefiningPause = 2;
constexpr double kMarginOfWait = 0.05;

/// `software`: then others than this thread draw, and what they draw of is made beside them.
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

/// The finest level of nodes that has samples of this stored level, or of the next coarser one that
/// any has; of those above the stored ones none.
int finest_node_level(const NodeGrid& grid, int stored) {
  int v = 0;
  while (v < grid.coarsest_stored() && grid.level(v).source < stored) ++v;
  return v;
}

/// Whether both show the same.
bool same_meshes(const Drawable* a, const Drawable* b) {
  if (a == nullptr || b == nullptr || a == b) return a == b;
  return std::equal(a->nodes.begin(), a->nodes.end(), b->nodes.begin(), b->nodes.end(),
                    [](const NodeDraw& p, const NodeDraw& q) {
                      return p.mesh == q.mesh && p.isovalue == q.isovalue;
                    });
}

}  // namespace

FrameOptions FrameOptions::in_window(const FramePacer& pacer, bool software, bool moving) {
  FrameOptions way{
      .max_triangles = moving ? pacer.max_triangles() : FramePacer::kAllTriangles,
      .thin_triangles = moving ? pacer.thin_triangles() : 0,
      .piece_seconds = software ? kPieceSeconds : std::numeric_limits<double>::infinity(),
      .moving = moving,
      .smaller = moving ? pacer.smaller() : 1};
  // Nor should pictures that follow while meshes come in wait for a good one.
  if (pacer.plain()) way.plain = moving ? Plain::yes : Plain::until_complete;
  return way;
}

SceneRenderer::SceneRenderer(std::shared_ptr<const StoreReader> store,
                             const PictureBudgets& budgets, std::function<void()> on_change,
                             std::shared_ptr<PictureSetup> setup)
    : store_(std::move(store)),
      budgets_(budgets),
      reading_(std::async(std::launch::async,
                          [&, software = current_gl_device().software] {
                            return std::make_unique<Scene>(
                                store_bricks(store_),
                                stream_options(budgets_, on_change, software));
                          })),
      setup_(setup ? std::move(setup) : std::make_shared<PictureSetup>(budgets, on_change)),
      uploads_(setup_->pool(),
               setup_->software() ? MeshUploads::Unused::go : MeshUploads::Unused::stay),
      slices_(budgets, last_sample(*store_), store_->info().type) {
  scene_ = reading_.get();
  device_ = std::make_unique<DeviceMeshes>(scene_->stream(), setup_->device());
  device_->use(budgets.backend);
  renderer().discard();  // that of another store
}

SceneRenderer::~SceneRenderer() = default;

void SceneRenderer::update_scene(const Camera& camera, int width, int height,
                                 const ViewSettings& settings, const FrameOptions& way) {
  std::vector<double> isovalues;
  shown_surfaces_.clear();
  for (std::size_t i = 0; i < settings.surfaces.size(); ++i)
    if (settings.surfaces[i].shown) {
      isovalues.push_back(settings.surfaces[i].isovalue);
      shown_surfaces_.push_back(i);
    }
  View view = view_of(camera, width, height, settings.pixel_error);
  view.finest_level = finest_node_level(scene_->tree().grid(), settings.finest_level);
  view.thin_pixel_error = view.pixel_error / way.smaller;
  const ClipRegion box = clip_region(settings);
  if (!box.whole()) {
    const Vec3d last = last_sample(*store_);
    view.clip = IndexBox{box.lo * last, box.hi * last};
  }
  view.planes = clip_half_spaces(settings);
  CutBudget budget;
  budget.triangles = std::min(budget.triangles, way.max_triangles);
  budget.thin_triangles = way.thin_triangles;
  // What stands in until the cut is there takes room beside it.
  const std::uint64_t there = device_->kernel_lock() != nullptr
                                  ? DeviceMeshes::cache_bytes(device_->held())
                                  : upload_memory();
  budget.mesh_bytes = std::min(there, budgets_.memory / 2) / 2;
  scene_->update(isovalues, view, budget);
}

void SceneRenderer::upload(const std::shared_ptr<const Drawable>& newest) {
  MeshUploads::Share share;
  // The first picture takes what it needs.
  const auto add = [&](const Drawable& drawable) {
    return uploads_.add(drawable, scene_->origin(), shown_ == nullptr ? nullptr : &share);
  };
  if (shown_ != nullptr) uploads_.keep(*shown_);
  // What was begun first, or nothing would be finished while there is always something newer; but
  // nothing newer than all of a surface will come.
  const bool last = next_ != nullptr && newest->complete && next_->isovalues == newest->isovalues;
  if (next_ != nullptr && next_ != shown_ && !last) {
    if (!add(*next_)) return;
    shown_ = next_;
  }
  next_ = newest;
  if (add(*next_)) shown_ = next_;
}

/// Whether what is new can be shown a little later, since more is to come.
bool SceneRenderer::can_wait(const Drawable& newest) const {
  if (shown_ == nullptr || !shown_->covers || newest.complete ||
      shown_->isovalues != newest.isovalues)
    return false;
  const double pause = kRefiningPause * picture_seconds_;
  return std::chrono::duration<double>(Clock::now() - drawn_).count() <
         (device_->kernel_lock() != nullptr ? std::max(pause, kRefiningSeconds) : pause);
}

bool SceneRenderer::may_be_plain(const Asked& asked) const {
  if (asked.way.plain != FrameOptions::Plain::until_complete)
    return asked.way.plain == FrameOptions::Plain::yes;
  if (setup_->software()) return !state_.complete;
  // A full budget may leave the newest incomplete.
  return shown_ != asked.newest || !(asked.idle || asked.newest->complete);
}

void SceneRenderer::drop_unused() {
  if (shown_ != nullptr) uploads_.keep(*shown_);
  uploads_.drop(upload_memory());
  state_.device_bytes = uploads_.bytes() + device_->held() + slices_.bytes();
}

/// What is uploaded, slices and the device's own meshes share its memory.
std::uint64_t SceneRenderer::upload_memory() const {
  const std::uint64_t others = device_->reserved() + slices_.bytes();
  return budgets_.device_memory - std::min(others, budgets_.device_memory);
}

/// Whether a picture that has been begun is still worth finishing.
bool SceneRenderer::still_wanted(const Work& work, const Asked& asked) const {
  const Shows& shows = work.becomes.shows;
  // A picture in full serves as a plain one, and a plain one comes first.
  const bool same_view = shows == asked.shows || shows == asked.shows_plain;
  if (same_view && work.isovalues == scene_->isovalues()) return true;
  return work.state.moving && asked.way.moving &&
         2 * asked.newest->triangles >= work.state.triangles;
}

/// Whether the next picture would show no more than the last one.
bool SceneRenderer::shows_all_there_is(const Pictured& next, const Asked& asked) const {
  if (pictured_.shows != next.shows && pictured_.shows != asked.shows) return false;
  if (!pictured_.stale && pictured_.slices == next.slices &&
      same_meshes(pictured_.meshes.get(), next.meshes.get()))
    return true;
  // Meshes of another isovalue are awaited; a picture of this one was dropped for that.
  return !asked.idle && pictured_.stale && pictured_.slices == next.slices &&
         pictured_.isovalues == next.isovalues && next.isovalues != scene_->isovalues();
}

/// Unless it would show nothing new.
void SceneRenderer::choose_picture(const Asked& asked) {
  Stopwatch watch;
  const bool plain_serves =
      asked.way.plain != FrameOptions::Plain::no && pictured_.shows == asked.shows_plain;
  const bool other_view = pictured_.shows != asked.shows && !plain_serves;
  const bool enough = imported_ && shown_ != nullptr;
  if (!enough && (other_view || asked.idle || !can_wait(*asked.newest))) upload(asked.newest);
  times_.upload = watch.lap();
  slices_.update(scene_->stream(), asked.settings);
  times_.slices = watch.lap();
  const bool plain = may_be_plain(asked);
  Pictured next{.shows = plain ? asked.shows_plain : asked.shows,
                .meshes = shown_,
                .slices = slices_.samples(),
                .isovalues = {}};
  if (shown_ != nullptr) next.isovalues = shown_->isovalues;
  // A pointer that moves over panels must not cost a picture, nor a cut that shows nothing new yet.
  if (shows_all_there_is(next, asked)) return;
  if (pictured_.slices != next.slices || !same_meshes(pictured_.meshes.get(), shown_.get())) {
    pictured_.stale = true;
    pictured_.meshes.reset();
    pictured_.slices = next.slices;
  }
  work_.emplace(Work{.becomes = std::move(next), .state = {}, .isovalues = scene_->isovalues()});
  work_->state.moving = asked.way.moving;
  work_->state.plain = plain;
}

void SceneRenderer::draw(const Camera& camera, int width, int height, const ViewSettings& settings,
                         const FrameOptions& way) {
  try {
    draw_next(camera, width, height, settings, way);
  } catch (...) {
    glFinish();
    if (work_) drop_picture();
    pictured_ = {};  // half a picture is none
    drew_ = imported_ = false;
    state_.drawing = state_.more = state_.complete = false;
    state_.drawn_part = 0;
    throw;
  }
}

void SceneRenderer::draw_next(const Camera& camera, int width, int height,
                              const ViewSettings& settings, const FrameOptions& way) {
  uploads_.begin_use();
  drew_ = false;
  Stopwatch watch;
  // Until there is a picture of what is asked for, every other time is for what has arrived.
  imported_ = !work_ && (state_.covers || !imported_) && device_->update();
  times_ = {.device = watch.lap()};
  update_scene(camera, width, height, settings, way);
  times_.scene = watch.lap();
  const bool idle = scene_->idle();  // first: then the newest has everything
  Shows shows{camera, width, height, settings};
  for (SurfaceSettings& surface : shows.settings.surfaces) surface.isovalue = 0;
  Shows plain = shows;
  plain.settings.occlusion = plain.settings.multisample = false;
  const Asked asked{.camera = camera,
                    .width = width,
                    .height = height,
                    .settings = settings,
                    .way = way,
                    .shows = std::move(shows),
                    .shows_plain = std::move(plain),
                    .idle = idle,
                    .newest = scene_->drawable()};
  times_.drawable = watch.lap();
  if (work_ && !still_wanted(*work_, asked)) drop_picture();
  const bool goes_on = work_.has_value();
  if (!goes_on) choose_picture(asked);
  if (work_) {
    watch.lap();
    // Two contexts of one device are changed slowly and to and fro: one after the other is
    // sooner done, for both.
    const TicketGuard guard(device_->kernel_lock());
    times_.turn = watch.lap();
    if (!goes_on) begin_picture(asked);
    draw_piece(asked.way.piece_seconds);
  }
  watch.lap();
  drop_unused();
  update_state(asked);
  times_.tidy = watch.lap();
}

void SceneRenderer::update_state(const Asked& asked) {
  state_.drawing = work_.has_value();
  state_.drawn_part = work_ && work_->all > 0 ? 1 - static_cast<double>(renderer().work_left()) /
                                                        static_cast<double>(work_->all)
                                              : 0;
  state_.plain = pictured_.shows != asked.shows;
  // One that is no simpler than those at rest is not drawn again.
  if (!work_ && !asked.way.moving && !state_.plain) state_.moving = false;
  state_.limited = scene_->cut().limited_by_budget;
  state_.thin = scene_->cut().triangles > asked.way.max_triangles;
  state_.limited_by_budget = state_.limited && asked.way.max_triangles == FramePacer::kAllTriangles;
  state_.covers = shown_ != nullptr && shown_->covers && shown_->isovalues == scene_->isovalues();
  state_.more = imported_ || device_->more();
  state_.complete = !asked.way.moving && !work_ && shown_ != nullptr &&
                    scene_->is_newest(*shown_) && (shown_->complete || scene_->idle());
}

void SceneRenderer::draw_complete(const Camera& camera, int width, int height,
                                  const ViewSettings& settings, const std::function<void()>& wait) {
  const FrameOptions way{.piece_seconds = kPieceSeconds, .in_order = true};
  for (;;) {
    draw(camera, width, height, settings, way);
    // The cut depends on what meshes were like; once more, it may be another.
    if (state_.complete) {
      draw(camera, width, height, settings, way);
      if (state_.complete) return;
    }
    wait();
    if (!state_.drawing && !state_.more) scene_->stream().wait_idle(kMarginOfWait);
  }
}

}  // namespace isobrick
