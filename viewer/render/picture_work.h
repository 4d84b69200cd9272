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

namespace isobrick {

/// What draws a picture.
struct PicturePasses {
  MeshPass meshes;
  SlicePass slices;
  OverlayPass overlays;
};

/// What is left to do of a picture whose parts are all known: meshes and slices, opaque ones
/// first, then the steps over the whole picture, then what lies on top. Done in pieces of any
/// size, it gives the same bytes. Work is counted in triangles; a pixel of a step counts as
/// many as take as long in software.
class PictureWork {
 public:
  /// Starts anew, with the queues empty.
  void start(const PictureTargets& targets, const PictureSettings& settings);

  MeshQueue& meshes(bool transparent) { return transparent ? transparent_ : opaque_; }
  /// What is left, slices and lines aside, which take next to nothing.
  std::uint64_t left() const;

  /// Draws meshes and slices: opaque ones or transparent ones, into the framebuffer that is bound.
  /// Takes what that comes to from `work`; whether none of them is left.
  bool draw_surfaces(PicturePasses& passes, Vec3d eye, bool transparent, std::uint64_t& work);
  /// Whether there is anything to draw there.
  bool any_surfaces(const PicturePasses& passes, bool transparent) const;
  /// The steps over the whole picture; otherwise as draw_surfaces().
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
