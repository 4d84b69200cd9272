#include "isobrick/window/store_picture.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstring>
#include <limits>

#include <epoxy/gl.h>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "isobrick/core/length_unit.h"
#include "isobrick/core/stopwatch.h"
#include "isobrick/render/vectors.h"

namespace isobrick {
namespace {

using Clock = std::chrono::steady_clock;

/// While meshes come in and nothing else changes: seconds between pictures, which would keep the
/// device that draws them from making meshes.
constexpr double kRefiningSeconds = 0.04;
/// The same, in times of the last picture: pictures that are soon out of date, and may take
/// seconds in software, take a third of the time at most.
constexpr double kRefiningPause = 2;
constexpr Vec3f kMarkColour{0.85f, 0.1f, 0.1f}, kBoxColour{0.35f, 0.38f, 0.42f};
constexpr double kMarginOfWait = 0.05;

/// Of host memory: what slices take, with what the renderer is given of them.
std::uint64_t slice_memory(const PictureBudgets& budgets) { return budgets.memory / 8; }

/// Most that the samples of one slice may take: beside them are as many floats, and on the device.
std::uint64_t slice_bytes(const PictureBudgets& budgets, ScalarType type) {
  const std::uint64_t sample = std::min<std::uint64_t>(size_of(type), sizeof(float));
  const std::uint64_t samples = std::min(slice_memory(budgets) / 3 / (sample + sizeof(float)),
                                         budgets.device_memory / 8 / 3 / sizeof(float));
  return std::min(SliceRequest{}.bytes, samples * sample);
}

StreamOptions stream_options(const PictureBudgets& budgets, std::function<void()> on_change) {
  StreamOptions options;
  options.threads = budgets.threads;
  options.mesh_bytes = budgets.memory / 2;
  options.brick_bytes = budgets.memory - options.mesh_bytes - slice_memory(budgets);
  options.device_bytes = DeviceMeshes::cache_bytes(budgets.device_mesh_memory());
  options.on_change = std::move(on_change);
  return options;
}

template <class T>
void append_floats(const std::vector<std::byte>& pixels, std::vector<float>& samples) {
  samples.resize(pixels.size() / sizeof(T));
  for (std::size_t i = 0; i < samples.size(); ++i) {
    T value;
    std::memcpy(&value, pixels.data() + i * sizeof(T), sizeof(T));
    samples[i] = static_cast<float>(value);
  }
}

std::vector<float> floats_of(const SliceSamples& slice) {
  std::vector<float> samples;
  if (slice.type == ScalarType::u8)
    append_floats<std::uint8_t>(slice.pixels, samples);
  else if (slice.type == ScalarType::u16)
    append_floats<std::uint16_t>(slice.pixels, samples);
  else
    append_floats<float>(slice.pixels, samples);
  return samples;
}

/// Room of a block of what is uploaded: little of the budget, so that little of it is idle. Meshes
/// that are larger have blocks of their own.
std::uint32_t pool_vertices(const PictureBudgets& budgets) {
  constexpr std::uint64_t vertex = 4 * sizeof(Vec3f);  // with a normal and two triangles
  return static_cast<std::uint32_t>(
      std::clamp<std::uint64_t>(budgets.device_memory / 128 / vertex, 1u << 12, 1u << 19));
}

/// Whether both show the same.
bool same_meshes(const Drawable* a, const Drawable* b) {
  if (a == nullptr || b == nullptr || a == b) return a == b;
  return std::equal(a->nodes.begin(), a->nodes.end(), b->nodes.begin(), b->nodes.end(),
                    [](const DrawnNode& p, const DrawnNode& q) {
                      return p.mesh == q.mesh && p.isovalue == q.isovalue;
                    });
}

/// What a picture depends on beside the meshes and slices that there are. An isovalue
/// shows when meshes of it are there, and not before.
std::string what_shows(const Camera& camera, int width, int height, ViewSettings settings) {
  for (SurfaceSettings& surface : settings.surfaces) surface.isovalue = 0;
  return fmt::format("{} {} {} {}", width, height, to_json(camera).dump(),
                     to_json(settings).dump());
}

}  // namespace

StorePicture::StorePicture(std::shared_ptr<const StoreReader> store, const PictureBudgets& budgets,
                           std::function<void()> on_change, std::shared_ptr<PictureSetup> setup)
    : store_(std::move(store)),
      budgets_(budgets),
      reading_(std::async(std::launch::async,
                          [&] {
                            return std::make_unique<Scene>(store_bricks(store_),
                                                           stream_options(budgets_, on_change));
                          })),
      setup_(setup ? std::move(setup) : std::make_shared<PictureSetup>(budgets, on_change)),
      pool_(pool_vertices(budgets)) {
  scene_ = reading_.get();
  device_ = std::make_unique<DeviceMeshes>(scene_->stream(), setup_->device());
  device_->use(budgets.backend);
}

StorePicture::~StorePicture() = default;

WorldBox StorePicture::bounds() const {
  const auto c = corners(scene_->tree().grid().transform(), {0, 0, 0}, last_sample(*store_));
  WorldBox box{c[0], c[0]};
  for (const Vec3d& p : c)
    for (int axis = 0; axis < 3; ++axis) {
      box.lo[axis] = std::min(box.lo[axis], p[axis]);
      box.hi[axis] = std::max(box.hi[axis], p[axis]);
    }
  return box;
}

void StorePicture::update_scene(const Camera& camera, int width, int height,
                                const ViewSettings& settings, double coarser) {
  std::vector<double> isovalues;
  shown_surfaces_.clear();
  for (std::size_t i = 0; i < settings.surfaces.size(); ++i)
    if (settings.surfaces[i].shown) {
      isovalues.push_back(settings.surfaces[i].isovalue);
      shown_surfaces_.push_back(i);
    }
  View view = view_of(camera, width, height, settings.pixel_error * coarser);
  const ShownBox box = shown_box(settings);
  if (!box.whole()) {
    const Vec3d last = last_sample(*store_);
    view.clip = IndexBox{box.lo * last, box.hi * last};
  }
  view.planes = shown_half_spaces(settings);
  CutBudget budget;
  // What stands in until the cut is there takes room beside it.
  const std::uint64_t there =
      device_->turns() != nullptr ? DeviceMeshes::cache_bytes(device_->held()) : upload_memory();
  budget.mesh_bytes = std::min(there, budgets_.memory / 2) / 2;
  scene_->update(isovalues, view, budget);
}

void StorePicture::upload(const std::shared_ptr<const Drawable>& newest) {
  UploadShare share;
  // What was begun first, or nothing would be finished while there is always something newer.
  if (next_ != nullptr && next_ != shown_ && !upload_all(*next_, share)) return;
  if (next_ != nullptr) shown_ = next_;
  next_ = newest;
  if (upload_all(*next_, share)) shown_ = next_;
}

/// Whether what is new can be shown a little later, since more is to come.
bool StorePicture::can_wait(const Drawable& newest) const {
  if (shown_ == nullptr || !shown_->covers || newest.complete ||
      shown_->isovalues != newest.isovalues)
    return false;
  const double pause = kRefiningPause * draw_seconds_;
  return std::chrono::duration<double>(Clock::now() - drawn_).count() <
         (device_->turns() != nullptr ? std::max(pause, kRefiningSeconds) : pause);
}

/// `idle`: nothing finer than the newest is to come, though a full budget may leave it incomplete.
bool StorePicture::may_be_plain(const PictureWay& way, const Drawable& newest, bool idle) const {
  if (way.plain != PictureWay::Plain::until_complete) return way.plain == PictureWay::Plain::yes;
  if (setup_->software()) return !state_.complete;
  return shown_.get() != &newest || !(newest.complete || idle);
}

bool StorePicture::upload_all(const Drawable& drawable, UploadShare& share) {
  for (const DrawnNode& node : drawable.nodes) {
    if (node.mesh->device) continue;
    Upload& upload = uploads_[node.mesh->id()];
    upload.used = frame_;
    if (upload.there) continue;
    if (shown_ != nullptr && share.spent()) return false;  // the rest with the next picture
    upload.there = true;
    if (node.mesh->empty()) continue;
    upload.place = pool_.add(node.mesh->mesh.chunk(0), scene_->origin());
    share.bytes += upload.place.bytes();
  }
  return true;
}

void StorePicture::drop_unused() {
  if (shown_ != nullptr)
    for (const DrawnNode& node : shown_->nodes) {
      if (node.mesh->device) continue;
      if (const auto upload = uploads_.find(node.mesh->id()); upload != uploads_.end())
        upload->second.used = frame_;
    }
  drop_uploads(upload_memory());
  state_.device_bytes = pool_.capacity() + device_->held() + slice_bytes_there();
}

std::uint64_t StorePicture::slice_bytes_there() const {
  std::uint64_t bytes = 0;
  for (const ShownSlice& slice : slices_) bytes += slice.samples.size() * sizeof(float);
  return bytes;
}

/// What is uploaded, slices and the device's own meshes share its memory.
std::uint64_t StorePicture::upload_memory() const {
  const std::uint64_t others = device_->reserved() + slice_bytes_there();
  return budgets_.device_memory - std::min(others, budgets_.device_memory);
}

/// Drops what is not drawn, the oldest first, until no more than this is held for uploads.
void StorePicture::drop_uploads(std::uint64_t most) {
  if (pool_.capacity() <= most) return;
  std::vector<std::pair<std::uint64_t, MeshId>> oldest;
  for (const auto& [id, upload] : uploads_)
    if (upload.used != frame_) oldest.emplace_back(upload.used, id);
  std::sort(oldest.begin(), oldest.end(),
            [](const auto& a, const auto& b) { return a.first < b.first; });
  for (const auto& [used, id] : oldest) {
    uploads_.erase(id);
    pool_.trim();
    if (pool_.capacity() <= most) return;
  }
}

PictureSettings StorePicture::picture_settings(const ViewSettings& settings) const {
  PictureSettings picture;
  picture.background_top = settings.background_top;
  picture.background_bottom = settings.background_bottom;
  picture.occlusion = settings.occlusion;
  picture.edges = settings.edges;
  picture.multisample = settings.multisample;
  picture.picking = true;
  picture.planes = shown_half_spaces(settings);
  const ShownBox box = shown_box(settings);
  const Transform& transform = scene_->tree().grid().transform();
  const Vec3d last = last_sample(*store_), zero = transform.apply({0, 0, 0});
  for (int axis = 0; axis < 3; ++axis) {
    Vec3d step;
    step[axis] = 1;
    const Vec3d inward = unit(transform.apply(step) - zero, step);
    Vec3d place;
    place[axis] = box.lo[axis] * last[axis];
    if (box.lo[axis] > 0) picture.planes.push_back(half_space_at(transform.apply(place), inward));
    place[axis] = box.hi[axis] * last[axis];
    if (box.hi[axis] < 1)
      picture.planes.push_back(half_space_at(transform.apply(place), inward * -1.0));
  }
  return picture;
}

void StorePicture::draw_surfaces(const ViewSettings& settings) {
  state_.triangles = state_.nodes = 0;
  state_.damage.clear();
  state_.isovalues.assign(settings.surfaces.size(), std::numeric_limits<double>::quiet_NaN());
  if (shown_ == nullptr) return;
  for (const DrawnNode& node : shown_->nodes) {
    if (!node.mesh->damage.empty()) {
      state_.damage.push_back(node.mesh->damage);
      continue;
    }
    const auto number = static_cast<std::size_t>(node.isovalue);
    const PooledMesh* mesh = nullptr;
    if (node.mesh->device)
      mesh = &device_->drawn(*node.mesh, scene_->origin());
    else if (const auto upload = uploads_.find(node.mesh->id()); upload != uploads_.end())
      mesh = &upload->second.place;
    if (number >= shown_surfaces_.size() || mesh == nullptr || mesh->empty()) continue;
    const SurfaceSettings& surface = settings.surfaces[shown_surfaces_[number]];
    state_.isovalues[shown_surfaces_[number]] = node.mesh->isovalue;
    MeshStyle style;
    style.colour = surface.colour;
    style.opacity = surface.opacity;
    style.id = static_cast<std::uint32_t>(shown_surfaces_[number] + 1);
    renderer().draw(*mesh, style);
    state_.triangles += node.mesh->triangles();
    ++state_.nodes;
  }
}

bool StorePicture::update_slices(const ViewSettings& settings) {
  const Vec3d last = last_sample(*store_);
  bool changed = false;
  for (int axis = 0; axis < 3; ++axis) {
    const auto slot = static_cast<std::size_t>(axis);
    ShownSlice& shown = slices_[slot];
    if (!settings.slices[slot].shown) {
      if (shown.asked) scene_->stream().set_slice(axis, std::nullopt);
      changed |= shown.from != nullptr;
      shown = {};
      continue;
    }
    shown.asked = true;
    SliceRequest request;
    request.axis = axis;
    request.bytes = slice_bytes(budgets_, store_->info().type);
    request.position = settings.slices[slot].place * last[axis];
    scene_->stream().set_slice(axis, request);
    // Until it is there the last one stays.
    const auto slice = scene_->stream().slice(axis);
    if (slice == nullptr || slice == shown.from) continue;
    shown = {slice, floats_of(*slice), true};
    changed = true;
  }
  return changed;
}

void StorePicture::draw_slices(const ViewSettings& settings) {
  for (const ShownSlice& shown : slices_) {
    if (shown.from == nullptr) continue;
    const SliceSamples& from = *shown.from;
    if (!from.damage.empty()) state_.damage.push_back(from.damage);
    SliceImage image;
    image.corner = from.corner;
    image.along_x = from.along_width;
    image.along_y = from.along_height;
    image.width = static_cast<int>(from.width);
    image.height = static_cast<int>(from.height);
    image.samples = shown.samples;
    image.window_lo = settings.window_lo;
    image.window_hi = settings.window_hi;
    renderer().draw(image);
  }
}

void StorePicture::draw_marks(const ViewSettings& settings) {
  const NodeGrid& grid = scene_->tree().grid();
  const Transform& transform = grid.transform();
  if (shown_ != nullptr)
    for (const DrawnNode& node : shown_->nodes) {
      if (node.mesh->damage.empty()) continue;
      const IndexBox box = grid.box(node.mesh->key);
      const auto c = corners(transform, box.lo, box.hi);
      std::vector<WorldLine> lines = edges(c);
      for (std::size_t i = 0; i < 4; ++i) lines.push_back({c[i], c[7 - i]});  // a cross inside
      renderer().draw_lines(lines, kMarkColour, 2);
    }
  if (settings.box)
    renderer().draw_lines(edges(corners(transform, {0, 0, 0}, last_sample(*store_))), kBoxColour);
  if (settings.axes) renderer().draw_axes();
  if (settings.scale_bar) renderer().draw_scale_bar(unit_symbol(transform.unit));
}

void StorePicture::draw(const Camera& camera, int width, int height, const ViewSettings& asked,
                        const PictureWay& way) {
  ++frame_;
  Stopwatch watch;
  state_.imports = device_->update();
  times_ = {.device = watch.lap()};
  update_scene(camera, width, height, asked, way.coarser);
  times_.scene = scene_->times();
  watch.lap();
  const auto before = shown_;
  const bool idle = scene_->stream().idle();  // first: then the newest has everything
  const auto newest = scene_->drawable();
  times_.drawable = watch.lap();
  ViewSettings plain = asked;
  plain.occlusion = plain.multisample = false;
  const std::string shows_all = what_shows(camera, width, height, asked);
  const std::string shows_plain = what_shows(camera, width, height, plain);
  // A picture in full serves as a plain one.
  const bool plain_serves = way.plain != PictureWay::Plain::no && shows_ == shows_plain;
  const bool other_view = shows_ != shows_all && !plain_serves;
  if (other_view || idle || !can_wait(*newest)) upload(newest);
  const bool be_plain = may_be_plain(way, *newest, idle);
  const ViewSettings& settings = be_plain ? plain : asked;
  const std::string& shows = be_plain ? shows_plain : shows_all;
  times_.upload = watch.lap();
  const bool other_slices = update_slices(settings);
  times_.slices = watch.lap();
  // A pointer that moves over panels must not cost a picture, nor a cut that shows nothing new yet.
  if (other_slices || !same_meshes(before.get(), shown_.get()) ||
      (shows_ != shows && shows_ != shows_all)) {
    // Two contexts of one device are changed slowly and to and fro: one after the other is sooner
    // done, for both.
    Turns* const turns = device_->turns();
    const Turn turn(turns);
    times_.turn = watch.lap();
    try {
      renderer().begin(camera, width, height, picture_settings(settings));
      draw_surfaces(settings);
      draw_slices(settings);
      draw_marks(settings);
      renderer().end();
    } catch (...) {
      shows_.clear();  // half a picture is none
      glFinish();
      device_->forget();
      throw;
    }
    times_.draw = watch.lap();
    glFinish();  // see DeviceMeshes::drawn(); and drawing counts for the pause after it
    times_.finish = watch.lap();
    device_->forget();
    shows_ = shows;
    drawn_ = Clock::now();
    draw_seconds_ = times_.draw + times_.finish;
  }
  drop_unused();
  state_.plain = shows_ != shows_all;
  state_.limited_by_budget = scene_->cut().limited_by_budget;
  state_.covers =
      shown_ != nullptr && shown_->covers && shown_->isovalues == scene_->cut().isovalues;
  state_.complete = shown_ != nullptr && shown_ == scene_->drawable() &&
                    (shown_->complete || scene_->stream().idle());
  times_.tidy = watch.lap();
}

void StorePicture::draw_complete(const Camera& camera, int width, int height,
                                 const ViewSettings& settings, const std::function<void()>& wait) {
  for (;;) {
    draw(camera, width, height, settings);
    // The cut depends on what meshes were like; once more, it may be another.
    if (state_.complete) {
      draw(camera, width, height, settings);
      if (state_.complete) return;
    }
    wait();
    scene_->stream().wait_idle(kMarginOfWait);
  }
}

}  // namespace isobrick
