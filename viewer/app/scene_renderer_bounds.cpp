#include <algorithm>
#include <vector>

#include "viewer/app/scene_renderer.h"
#include "viewer/scene/surface_box.h"

// World-space bounds of a store, and of what is shown of it.

namespace isobrick {
namespace {

WorldBox world_box(const Transform& transform, const IndexBox& box) {
  const auto c = corners(transform, box.lo, box.hi);
  WorldBox world{c[0], c[0]};
  for (const Vec3d& p : c)
    for (int axis = 0; axis < 3; ++axis) {
      world.lo[axis] = std::min(world.lo[axis], p[axis]);
      world.hi[axis] = std::max(world.hi[axis], p[axis]);
    }
  return world;
}

void include(std::optional<IndexBox>& box, const IndexBox& more) {
  if (!box) box = more;
  for (int axis = 0; axis < 3; ++axis) {
    box->lo[axis] = std::min(box->lo[axis], more.lo[axis]);
    box->hi[axis] = std::max(box->hi[axis], more.hi[axis]);
  }
}

}  // namespace

WorldBox SceneRenderer::bounds() const {
  return world_box(scene_->tree().grid().transform(), {{0, 0, 0}, last_sample(*store_)});
}

WorldBox SceneRenderer::shown_bounds(const ViewSettings& settings) const {
  const Vec3d last = last_sample(*store_);
  const ClipRegion shown = clip_region(settings);
  const IndexBox part{shown.lo * last, shown.hi * last};
  std::vector<double> isovalues;
  for (const SurfaceSettings& surface : settings.surfaces)
    if (surface.shown) isovalues.push_back(surface.isovalue);
  std::optional<IndexBox> box = surface_box(*store_bricks(store_), scene_->tree(), isovalues, part);
  for (int axis = 0; axis < 3; ++axis) {
    const SliceSettings& slice = settings.slices[static_cast<std::size_t>(axis)];
    IndexBox plane = part;
    plane.lo[axis] = plane.hi[axis] = static_cast<double>(slice.position) * last[axis];
    if (slice.shown && part.lo[axis] <= plane.lo[axis] && plane.hi[axis] <= part.hi[axis])
      include(box, plane);
  }
  return world_box(scene_->tree().grid().transform(), box.value_or(IndexBox{{0, 0, 0}, last}));
}

}  // namespace isobrick
