#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "viewer/render/draw_switches.h"
#include "viewer/render/mesh_pass.h"
#include "viewer/render/mesh_queue.h"
#include "viewer/render/overlay_pass.h"
#include "viewer/render/screen_pass.h"
#include "viewer/render/slice_pass.h"

namespace isobrick::inline v0 {

/// The passes that draw a picture.
struct PicturePasses {
  MeshPass meshes;
  SlicePass slices;
  OverlayPass overlays;
};

/// The remaining work of a picture whose content is known: opaque meshes and slices, then
/// transparent ones, then the screen steps. Overlays follow. It can be done in batches of any size,
/// with the same bytes as a result. Work is counted in triangles; a pixel of a step counts as many
/// as take the same time in software.
class PictureWork {
 public:
  /// Starts a picture with empty queues.
  void start(const PictureTargets& targets, const PictureSettings& settings);

  MeshQueue& meshes(bool transparent) { return transparent ? transparent_ : opaque_; }
  /// Remaining work, without slices and lines, which take almost no time.
  std::uint64_t remaining() const;

  /// Draws opaque or transparent meshes and slices into the bound framebuffer. Subtracts the work
  /// done from `work`. Returns whether none is left.
  bool draw_surfaces(PicturePasses& passes, Vec3d eye, bool transparent, std::uint64_t& work);
  /// Whether draw_surfaces() has anything to draw.
  bool any_surfaces(const PicturePasses& passes, bool transparent) const;
  /// Runs the screen steps; `work` and the result as in draw_surfaces().
  bool run_steps(ScreenPass& screen, const ScreenPicture& picture, std::uint64_t& work);

 private:
  std::uint64_t row_work(std::size_t step) const;

  MeshQueue opaque_, transparent_;
  bool slices_drawn_[2] = {};
  std::vector<ScreenPass::Step> steps_;
  std::size_t step_ = 0;
  int row_ = 0, width_ = 0, height_ = 0;
};

}  // namespace isobrick
