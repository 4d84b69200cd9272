#include "viewer/app/scene_renderer.h"

#include <epoxy/gl.h>

#include <chrono>
#include <cmath>
#include <limits>
#include <utility>

#include "core/stopwatch.h"
#include "viewer/app/damage_markers.h"

// How a picture that has been chosen is made, in pieces; scene_renderer.cpp chooses it.

namespace isobrick {
namespace {

constexpr std::uint64_t kWholePicture = std::numeric_limits<std::uint64_t>::max();

}  // namespace

/// Which of the settings' surfaces a mesh of `shown_` belongs to. That may have been made when
/// others were asked for: where there were as many, one has another isovalue by now.
std::optional<std::size_t> SceneRenderer::surface_of(const NodeDraw& node,
                                                     const ViewSettings& settings) const {
  const auto number = static_cast<std::size_t>(node.isovalue);
  if (shown_->isovalues.size() == shown_surfaces_.size()) return shown_surfaces_[number];
  for (const std::size_t i : shown_surfaces_)
    if (settings.surfaces[i].isovalue == node.mesh->isovalue) return i;
  return std::nullopt;
}

void SceneRenderer::draw_surfaces(const ViewSettings& settings, const PictureSettings& picture,
                                  PictureState& state) {
  state.isovalues.assign(settings.surfaces.size(), std::numeric_limits<double>::quiet_NaN());
  if (shown_ == nullptr) return;
  const ClipTest cuts(picture);
  for (const NodeDraw& node : shown_->nodes) {
    if (!node.mesh->damage.empty()) {
      state.damage.push_back(node.mesh->damage);
      continue;
    }
    const std::optional<std::size_t> number = surface_of(node, settings);
    const PooledMesh* mesh = nullptr;
    if (node.mesh->device)
      mesh = &device_->drawn(*node.mesh, scene_->origin());
    else
      mesh = uploads_.find(*node.mesh);
    if (!number || mesh == nullptr || mesh->empty()) continue;
    const SurfaceSettings& surface = settings.surfaces[*number];
    state.isovalues[*number] = node.mesh->isovalue;
    MeshStyle style;
    style.colour = surface.colour;
    style.opacity = surface.opacity;
    style.id = static_cast<std::uint32_t>(*number + 1);
    style.clip_mask = cuts.of(scene_->tree().grid(), node.mesh->key);
    renderer().draw(*mesh, style);
    state.triangles += node.mesh->triangles();
    ++state.nodes;
  }
}

void SceneRenderer::begin_picture(const Asked& asked) {
  Stopwatch watch;
  ViewSettings settings = asked.settings;
  if (work_->state.plain) settings.occlusion = settings.multisample = false;
  PictureSettings picture =
      picture_settings(settings, scene_->tree().grid().transform(), last_sample(*store_));
  picture.in_order = asked.way.in_order || setup_->software();
  picture.defer_overlays = asked.way.smaller > 1;
  picture.overlay_scale = asked.way.overlay_scale;
  renderer().begin(asked.camera, asked.width, asked.height, picture);
  draw_surfaces(settings, picture, work_->state);
  slices_.draw(renderer(), settings, work_->state.damage);
  draw_markers(renderer(), settings, scene_->tree().grid(), last_sample(*store_), shown_.get());
  work_->all = renderer().work_left();
  times_.draw = watch.lap();
}

/// Waits until OpenGL has drawn the piece before the one that was just submitted, or everything.
/// llvmpipe draws in part on this thread and in part beside it: the rest of a piece is drawn
/// beside the next one.
void SceneRenderer::wait_drawn(bool everything) {
  if (everything) {
    glFinish();  // see DeviceMeshes::drawn(); and drawing counts for the pause after it
    return piece_fence_.reset();
  }
  GlFence behind_this = GlFence::insert();
  if (piece_fence_) piece_fence_->wait();
  piece_fence_ = std::move(behind_this);
}

/// Draws the rest of the picture, or a piece of it where `limit` is finite.
void SceneRenderer::draw_piece(double limit) {
  const bool in_pieces = std::isfinite(limit);
  Stopwatch watch;
  const bool finished = renderer().advance(in_pieces ? pieces_.work() : kWholePicture);
  const double submitted = watch.lap();
  const int pieces = (piece_fence_ ? 1 : 0) + (finished ? 1 : 0);  // that are waited for
  wait_drawn(finished);
  const double waited = watch.lap();
  times_.draw += submitted;
  times_.finish += waited;
  if (in_pieces && pieces > 0) {
    const double seconds = (submitted + waited) / pieces;
    // The last piece is a small one, which makes no other larger.
    if (!finished || seconds > limit) pieces_.drawn(seconds, limit);
  }
  if (finished) return finish_picture();
  ++counters_.pieces;
  work_->seconds += times_.draw + times_.finish;
}

void SceneRenderer::finish_picture() {
  picture_seconds_ = work_->seconds + times_.draw + times_.finish;
  drawn_ = std::chrono::steady_clock::now();
  drew_ = true;
  ++counters_.finished;
  pictured_ = std::move(work_->becomes);
  state_.moving = work_->state.moving;
  state_.triangles = work_->state.triangles;
  state_.nodes = work_->state.nodes;
  state_.isovalues = std::move(work_->state.isovalues);
  state_.damage = std::move(work_->state.damage);
  work_.reset();
  device_->forget();
}

/// Waits for the piece that is still being drawn, if any: then its meshes may go.
void SceneRenderer::drop_picture() {
  ++counters_.dropped;
  if (piece_fence_) wait_drawn(true);
  work_.reset();
  device_->forget();
}

}  // namespace isobrick
