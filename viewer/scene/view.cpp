#include "viewer/scene/view.h"

#include <algorithm>
#include <cmath>

namespace isobrick::inline v0 {
namespace {

/// Scale of the picture in which refined nodes stay refined.
constexpr double kWider = 1.15;

bool touch(const IndexBox& a, const IndexBox& b) {
  for (int axis = 0; axis < 3; ++axis)
    if (a.hi[axis] < b.lo[axis] || b.hi[axis] < a.lo[axis]) return false;
  return true;
}

}  // namespace

NodeView::NodeView(const View& view, const NodeGrid& grid) : grid_(grid), clip_(view.clip) {
  const Transform& t = grid.transform();
  const auto& m = view.view_projection;
  for (int i = 0; i < 3; ++i) {
    spacing_[i] = std::abs(t.spacing[i]);
    eye_[i] = dot(t.step(i), view.eye - t.origin) / spacing_[i];
  }
  Plane rows[4];
  for (std::size_t r = 0; r < 4; ++r)
    rows[r] = to_index_space({m[r], m[4 + r], m[8 + r]}, m[12 + r]);
  for (std::size_t i = 0; i < 6; ++i) {
    const double sign = i % 2 ? -1 : 1;
    const auto plane = [&](double width) {
      return Plane{rows[3].normal * width + rows[i / 2].normal * sign,
                   rows[3].offset * width + sign * rows[i / 2].offset};
    };
    picture_[i] = plane(1);
    wider_[i] = plane(i < 4 ? kWider : 1);
  }
  for (const HalfSpace& half : view.planes)
    planes_.push_back(to_index_space(half.normal, -half.least));
  const Vec3d second{m[1], m[5], m[9]}, fourth{m[3], m[7], m[11]};
  const double w = std::sqrt(dot(fourth, fourth));
  parallel_ = w == 0;
  pixels_per_length_ = view.height / 2.0 * std::sqrt(dot(second, second)) / (parallel_ ? 1 : w);
}

/// Converts the plane normal · p + offset = 0 of world space.
NodeView::Plane NodeView::to_index_space(Vec3d normal, double offset) const {
  const Transform& t = grid_.transform();
  return {{dot(normal, t.step(0)), dot(normal, t.step(1)), dot(normal, t.step(2))},
          dot(normal, t.origin) + offset};
}

bool NodeView::Plane::intersects(const IndexBox& box) const {
  double max_distance = offset;
  for (int axis = 0; axis < 3; ++axis)
    max_distance += normal[axis] * (normal[axis] > 0 ? box.hi[axis] : box.lo[axis]);
  return max_distance >= 0;
}

bool NodeView::clipped(const IndexBox& box) const {
  return (clip_ && !touch(box, *clip_)) ||
         !std::all_of(planes_.begin(), planes_.end(),
                      [&](const Plane& plane) { return plane.intersects(box); });
}

NodeSight NodeView::sight(const NodeKey& n) const {
  const IndexBox box = grid_.box(n);
  NodeSight sight;
  sight.distance = distance(box);
  sight.pixels = pixels(n.level, sight.distance);
  sight.clipped = clipped(box);
  if (sight.clipped) return sight;
  const auto inside = [&](const Plane& plane) { return plane.intersects(box); };
  sight.nearly_visible = std::all_of(wider_.begin(), wider_.end(), inside);
  // The larger picture contains the other one.
  sight.visible = sight.nearly_visible && std::all_of(picture_.begin(), picture_.end(), inside);
  return sight;
}

double NodeView::distance(const IndexBox& box) const {
  Vec3d apart;
  for (int axis = 0; axis < 3; ++axis) {
    const double lo = box.lo[axis] * spacing_[axis], hi = box.hi[axis] * spacing_[axis];
    apart[axis] = std::max({lo - eye_[axis], eye_[axis] - hi, 0.0});
  }
  return std::sqrt(dot(apart, apart));
}

double NodeView::pixels(int level, double distance) const {
  const double cell = grid_.level(level).spacing;
  if (parallel_) return cell * pixels_per_length_;
  // Inside a node the distance may be 0; cells nearer than the length of one are not distinguished.
  return cell * pixels_per_length_ / std::max(distance, grid_.level(0).spacing);
}

}  // namespace isobrick
