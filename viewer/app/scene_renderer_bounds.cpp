#include <vector>

#include "core/box_union.h"
#include "viewer/app/scene_renderer.h"
#include "viewer/scene/surface_box.h"

// World-space bounds of a store, and of what is shown of it.

namespace isobrick::inline v0 {
namespace {

WorldBox world_box(const Transform& transform, const IndexBox& box) {
  BoxUnion<WorldBox> world;
  for (const Vec3d& p : corners(transform, box.lo, box.hi)) world.include({p, p});
  return *world.box();
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
  BoxUnion<IndexBox> shown_box(surface_box(*store_bricks(store_), scene_->tree(), isovalues, part));
  for (int axis = 0; axis < 3; ++axis) {
    const SliceSettings& slice = settings.slices[static_cast<std::size_t>(axis)];
    IndexBox plane = part;
    plane.lo[axis] = plane.hi[axis] = static_cast<double>(slice.position) * last[axis];
    if (slice.shown && part.lo[axis] <= plane.lo[axis] && plane.hi[axis] <= part.hi[axis])
      shown_box.include(plane);
  }
  return world_box(scene_->tree().grid().transform(),
                   shown_box.box().value_or(IndexBox{{0, 0, 0}, last}));
}

}  // namespace isobrick
