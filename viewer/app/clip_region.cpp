#include "viewer/app/clip_region.h"

#include <algorithm>
#include <cmath>

#include <glm/ext/matrix_transform.hpp>
#include <glm/gtc/type_ptr.hpp>

#include "core/vectors.h"

namespace isobrick::inline v0 {
namespace {

/// The range of the coarsest level's nodes: of their own samples, or of all below.
template <class RangeOf>
ValueRange<float> range_of_all(const NodeTree& tree, RangeOf&& range_of) {
  const int top = tree.grid().levels() - 1;
  ValueRange<float> all;
  for_each_point({{0, 0, 0}, tree.grid().level(top).nodes}, [&](Int3 p) {
    const ValueRange<float> r = range_of(NodeKey{top, p});
    if (!r.empty()) all.include(r);
  });
  return all;
}

}  // namespace

Vec3d last_sample(const StoreReader& store) {
  const Int3 extent = store.info().levels.front().lattice.extent;
  return {static_cast<double>(extent.x - 1), static_cast<double>(extent.y - 1),
          static_cast<double>(extent.z - 1)};
}

std::array<Vec3d, 8> corners(const Transform& transform, Vec3d lo, Vec3d hi) {
  std::array<Vec3d, 8> c;
  for (std::size_t i = 0; i < 8; ++i)
    c[i] = transform.apply(
        {(i & 1) != 0 ? hi.x : lo.x, (i & 2) != 0 ? hi.y : lo.y, (i & 4) != 0 ? hi.z : lo.z});
  return c;
}

std::vector<WorldLine> edges(const std::array<Vec3d, 8>& c) {
  std::vector<WorldLine> lines;
  for (std::size_t i = 0; i < 8; ++i)
    for (const std::size_t bit : {std::size_t{1}, std::size_t{2}, std::size_t{4}})
      if ((i & bit) == 0) lines.push_back({c[i], c[i | bit]});
  return lines;
}

void choose_values(ViewSettings& settings, const NodeTree& tree) {
  if (settings.surfaces.empty()) settings.surfaces.push_back({.colour = surface_colour(0)});
  const auto own = range_of_all(tree, [&](const NodeKey& n) { return tree.range(n); });
  for (SurfaceSettings& surface : settings.surfaces)
    if (std::isnan(surface.isovalue))
      surface.isovalue = own.empty() ? 0 : (static_cast<double>(own.lo) + own.hi) / 2;
  if (settings.window_lo < settings.window_hi) return;
  const auto all = range_of_all(tree, [&](const NodeKey& n) { return tree.range_below(n); });
  const bool known = !all.empty() && std::isfinite(all.lo) && std::isfinite(all.hi);
  settings.window_lo = known ? all.lo : 0;
  settings.window_hi = known ? all.hi : 1;
}

ClipRegion clip_region(const ViewSettings& settings) {
  ClipRegion box;
  for (int axis = 0; axis < 3; ++axis) {
    if (settings.region_on) {
      box.lo[axis] = std::clamp<double>(settings.region_lo[axis], 0, 1);
      box.hi[axis] = std::clamp<double>(settings.region_hi[axis], 0, 1);
    }
    const AxisClipSettings& clip = settings.axis_clips[static_cast<std::size_t>(axis)];
    if (!clip.on) continue;
    if (clip.above)
      box.hi[axis] = std::min<double>(box.hi[axis], clip.position);
    else
      box.lo[axis] = std::max<double>(box.lo[axis], clip.position);
  }
  return box;
}

std::vector<HalfSpace> clip_half_spaces(const ViewSettings& settings) {
  std::vector<HalfSpace> kept;
  for (const ClipPlaneSettings& plane : settings.planes)
    if (plane.on) kept.push_back(plane.kept);
  return kept;
}

PictureSettings picture_settings(const ViewSettings& settings, const Transform& transform,
                                 Vec3d last) {
  PictureSettings picture;
  picture.background_top = settings.background_top;
  picture.background_bottom = settings.background_bottom;
  picture.occlusion = settings.occlusion;
  picture.edges = settings.edges;
  picture.multisample = settings.multisample;
  picture.picking = true;
  picture.planes = clip_half_spaces(settings);
  const ClipRegion box = clip_region(settings);
  const Vec3d zero = transform.apply({0, 0, 0});
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

ClipTest::ClipTest(const PictureSettings& picture) : half_spaces_(picture.half_spaces()) {
  for (HalfSpace& half : half_spaces_) {
    const double scale = 1 / length(half.normal);
    half = {half.normal * scale, half.least * scale};
  }
}

std::uint16_t ClipTest::mask(Vec3d middle, double radius) const {
  unsigned bits = 0;
  for (std::size_t i = 0; i < half_spaces_.size(); ++i)
    if (dot(half_spaces_[i].normal, middle) - radius < half_spaces_[i].least) bits |= 1u << i;
  return static_cast<std::uint16_t>(bits);
}

/// Seam strips extend less than a cell beyond the node.
std::uint16_t ClipTest::mask(const NodeGrid& grid, const NodeKey& node) const {
  const IndexBox box = grid.box(node);
  const Transform& t = grid.transform();
  const Vec3d middle = t.apply((box.lo + box.hi) * 0.5);
  return mask(middle, length(t.apply(box.hi) - middle) + grid.level(node.level).spacing);
}

View view_of(const Camera& camera, int width, int height, double pixel_error) {
  View view;
  view.eye = camera.eye;
  const glm::dmat4 to_camera =
      glm::translate(glm::dmat4(camera.rotation()), {-camera.eye.x, -camera.eye.y, -camera.eye.z});
  const glm::dmat4 m = camera.projection(static_cast<double>(width) / height) * to_camera;
  std::copy_n(glm::value_ptr(m), 16, view.view_projection.begin());
  view.width = width;
  view.height = height;
  view.pixel_error = pixel_error;
  return view;
}

}  // namespace isobrick
