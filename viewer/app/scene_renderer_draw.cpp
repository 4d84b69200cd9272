#include "viewer/app/scene_renderer.h"

#include <epoxy/gl.h>

#include <chrono>
#include <cmath>
#include <limits>
#include <utility>

#include "core/stopwatch.h"
#include "viewer/app/damage_markers.h"

// Draws a chosen frame, in batches; scene_renderer.cpp chooses it.

namespace isobrick::inline v0 {
namespace {

constexpr std::uint64_t kAllWork = std::numeric_limits<std::uint64_t>::max();

}  // namespace

/// The settings' surface of a mesh of `shown_meshes_`. Those may still show previous isovalues:
/// then the surface has another isovalue by now.
std::optional<std::size_t> SceneRenderer::surface_of(const NodeDraw& node,
                                                     const ViewSettings& settings) const {
  const auto number = static_cast<std::size_t>(node.isovalue);
  if (shown_meshes_->isovalues.size() == shown_surfaces_.size()) return shown_surfaces_[number];
  for (const std::size_t i : shown_surfaces_)
    if (settings.surfaces[i].isovalue == node.mesh->isovalue) return i;
  return std::nullopt;
}

void SceneRenderer::draw_surfaces(const ViewSettings& settings, const PictureSettings& picture,
                                  FrameState& state) {
  state.isovalues.assign(settings.surfaces.size(), std::numeric_limits<double>::quiet_NaN());
  if (shown_meshes_ == nullptr) return;
  const ClipTest clip_test(picture);
  for (const NodeDraw& node : shown_meshes_->nodes) {
    if (!node.mesh->damage.empty()) {
      state.damage.push_back(node.mesh->damage);
      continue;
    }
    const std::optional<std::size_t> number = surface_of(node, settings);
    const PooledMesh* mesh = nullptr;
    if (node.mesh->device)
      mesh = &device_->borrow(*node.mesh, scene_->origin());
    else
      mesh = uploads_.find(*node.mesh);
    if (!number || mesh == nullptr || mesh->empty()) continue;
    const SurfaceSettings& surface = settings.surfaces[*number];
    state.isovalues[*number] = node.mesh->isovalue;
    MeshStyle style;
    style.colour = surface.colour;
    style.opacity = surface.opacity;
    style.id = static_cast<std::uint32_t>(*number + 1);
    style.clip_mask = clip_test.mask(scene_->tree().grid(), node.mesh->key);
    renderer().draw(*mesh, style);
    state.triangles += node.mesh->triangles();
    ++state.nodes;
  }
}

void SceneRenderer::begin_frame(const FrameRequest& request) {
  Stopwatch watch;
  ViewSettings settings = request.settings;
  if (pending_->state.reduced_quality) settings.occlusion = settings.multisample = false;
  PictureSettings picture =
      picture_settings(settings, scene_->tree().grid().transform(), last_sample(*store_));
  picture.in_order = request.options.in_order || setup_->software();
  picture.defer_overlays = request.options.size_divisor > 1;
  picture.overlay_scale = request.options.overlay_scale;
  renderer().begin(request.camera, request.width, request.height, picture);
  draw_surfaces(settings, picture, pending_->state);
  slices_.draw(renderer(), settings, pending_->state.damage);
  draw_markers(renderer(), settings, scene_->tree().grid(), last_sample(*store_),
               shown_meshes_.get());
  pending_->total_work = renderer().work_left();
  times_.draw = watch.lap();
}

/// Waits until OpenGL has drawn the previous batch, or everything. llvmpipe draws partly on this
/// thread and partly on others: the rest of a batch is drawn beside the next one.
void SceneRenderer::wait_for_gl(bool everything) {
  if (everything) {
    glFinish();  // see DeviceMeshes::borrow(); the time also sets the pause between frames
    return batch_fence_.reset();
  }
  GlFence fence = GlFence::insert();
  if (batch_fence_) batch_fence_->wait();
  batch_fence_ = std::move(fence);
}

/// Draws the rest of the frame, or a batch of it if `limit` is finite.
void SceneRenderer::draw_batch(double limit) {
  const bool in_batches = std::isfinite(limit);
  Stopwatch watch;
  const bool finished = renderer().advance(in_batches ? batch_pacer_.work() : kAllWork);
  const double submitted = watch.lap();
  const int batches =
      (batch_fence_ ? 1 : 0) + (finished ? 1 : 0);  // batches that wait_for_gl() waits for
  wait_for_gl(finished);
  const double waited = watch.lap();
  times_.draw += submitted;
  times_.finish += waited;
  if (in_batches && batches > 0) {
    const double seconds = (submitted + waited) / batches;
    // The last batch is small, so it is no reason for larger ones.
    if (!finished || seconds > limit) batch_pacer_.add(seconds, limit);
  }
  if (finished) return finish_frame();
  ++counters_.unfinished_batches;
  pending_->seconds += times_.draw + times_.finish;
}

void SceneRenderer::finish_frame() {
  frame_seconds_ = pending_->seconds + times_.draw + times_.finish;
  finish_time_ = std::chrono::steady_clock::now();
  has_new_frame_ = true;
  ++counters_.finished;
  shown_frame_ = std::move(pending_->frame);
  state_.moving = pending_->state.moving;
  state_.triangles = pending_->state.triangles;
  state_.nodes = pending_->state.nodes;
  state_.isovalues = std::move(pending_->state.isovalues);
  state_.damage = std::move(pending_->state.damage);
  pending_.reset();
  device_->release_borrowed();
}

/// Waits for a batch that is still being drawn, so that its meshes may be freed.
void SceneRenderer::drop_frame() {
  ++counters_.dropped;
  if (batch_fence_) wait_for_gl(true);
  pending_.reset();
  device_->release_borrowed();
}

}  // namespace isobrick
