#include "isobrick/window/store_picture.h"

#include <epoxy/gl.h>

#include <chrono>
#include <limits>
#include <utility>

#include "isobrick/core/stopwatch.h"
#include "isobrick/window/marks.h"

// How a picture that has been chosen is made, in pieces; store_picture.cpp chooses it.

namespace isobrick {

/// Which of the settings' surfaces a mesh of `shown_` belongs to. That may have been made when
/// others were asked for: where there were as many, one has another isovalue by now.
std::optional<std::size_t> StorePicture::surface_of(const DrawnNode& node,
                                                    const ViewSettings& settings) const {
  const auto number = static_cast<std::size_t>(node.isovalue);
  if (shown_->isovalues.size() == shown_surfaces_.size()) return shown_surfaces_[number];
  for (const std::size_t i : shown_surfaces_)
    if (settings.surfaces[i].isovalue == node.mesh->isovalue) return i;
  return std::nullopt;
}

void StorePicture::draw_surfaces(const ViewSettings& settings, const PictureSettings& picture,
                                 PictureState& state) {
  state.isovalues.assign(settings.surfaces.size(), std::numeric_limits<double>::quiet_NaN());
  if (shown_ == nullptr) return;
  const Cuts cuts(picture);
  for (const DrawnNode& node : shown_->nodes) {
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
    style.cut_by = cuts.of(scene_->tree().grid(), node.mesh->key);
    renderer().draw(*mesh, style);
    state.triangles += node.mesh->triangles();
    ++state.nodes;
  }
}

void StorePicture::begin_picture(const Asked& asked) {
  Stopwatch watch;
  ViewSettings settings = asked.settings;
  if (work_->state.plain) settings.occlusion = settings.multisample = false;
  PictureSettings picture =
      picture_settings(settings, scene_->tree().grid().transform(), last_sample(*store_));
  picture.in_order = asked.way.in_order || setup_->software();
  picture.overlays_later = asked.way.smaller;
  picture.overlay_scale = asked.way.overlay_scale;
  renderer().begin(asked.camera, asked.width, asked.height, picture);
  draw_surfaces(settings, picture, work_->state);
  slices_.draw(renderer(), settings, work_->state.damage);
  draw_marks(renderer(), settings, scene_->tree().grid(), last_sample(*store_), shown_.get());
  work_->all = renderer().work_left();
  times_.draw = watch.lap();
}

/// Until the piece before is drawn, with a fence behind the one that has just been told; without
/// one: until all is.
void StorePicture::wait_drawn(std::optional<GlFence> fence) {
  Stopwatch watch;
  if (!fence) {
    glFinish();  // see DeviceMeshes::drawn(); and drawing counts for the pause after it
    piece_fence_.reset();
    return pieces_.drawn_all(watch.lap());
  }
  if (piece_fence_) piece_fence_->wait();
  piece_fence_ = std::move(fence);
  pieces_.drawn_before_last(watch.lap());
}

/// As much as there is time for. In software the last piece alone is waited for at once: what is
/// told is drawn in part by the thread that tells it, and the rest beside the next piece.
void StorePicture::draw_piece(double most) {
  double left = most;
  for (;;) {
    Stopwatch watch;
    const std::uint64_t before = renderer().work_left();
    const bool finished = renderer().end_piece(pieces_.work(left, before));
    std::optional<GlFence> fence;
    if (!finished && setup_->software()) fence = GlFence::insert();
    const double told = watch.lap();
    pieces_.told(before - renderer().work_left(), told);
    wait_drawn(std::move(fence));
    const double waited = watch.lap();
    times_.draw += told;
    times_.finish += waited;
    left -= told + waited;
    if (finished) return finish_picture();
    if (left < kLeastPart * most) break;
  }
  ++counters_.pieces;
  work_->seconds += times_.draw + times_.finish;
}

void StorePicture::finish_picture() {
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
void StorePicture::drop_picture() {
  ++counters_.dropped;
  if (piece_fence_) wait_drawn({});
  work_.reset();
  device_->forget();
}

}  // namespace isobrick
