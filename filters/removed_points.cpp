#include "filters/removed_points.h"

namespace isobrick::inline v0 {

double squared_distance(Vec3d p, Vec3d a, Vec3d b, Vec3d c) {
  const Vec3d ab = b - a, ac = c - a, ap = p - a;
  const auto square = [](Vec3d v) { return dot(v, v); };
  const double d1 = dot(ab, ap), d2 = dot(ac, ap);
  if (d1 <= 0 && d2 <= 0) return square(ap);
  const Vec3d bp = p - b;
  const double d3 = dot(ab, bp), d4 = dot(ac, bp);
  if (d3 >= 0 && d4 <= d3) return square(bp);
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) return square(ap - ab * (d1 / (d1 - d3)));
  const Vec3d cp = p - c;
  const double d5 = dot(ab, cp), d6 = dot(ac, cp);
  if (d6 >= 0 && d5 <= d6) return square(cp);
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) return square(ap - ac * (d2 / (d2 - d6)));
  const double va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) {
    const double w = (d4 - d3) / ((d4 - d3) + (d5 - d6));
    return square(bp - (c - b) * w);
  }
  const double sum = va + vb + vc;
  if (!(sum > 0)) return square(ap);
  return square(ap - ab * (vb / sum) - ac * (vc / sum));
}

std::uint32_t RemovedPoints::nearest(Vec3d point, std::span<const Patch> patches) const {
  std::uint32_t found = kNone;
  double least = max_square_;
  for (const Patch& patch : patches) {
    const double square = squared_distance(point, patch.a, patch.b, patch.c);
    if (!(square <= least)) continue;
    least = square;
    found = patch.triangle;
  }
  return found;
}

bool RemovedPoints::find_nearest(std::uint32_t triangle, std::span<const Patch> patches) {
  for (std::uint32_t i = first_[triangle]; i != kNone; i = points_[i].next) {
    const std::uint32_t to = nearest(points_[i].position, patches);
    if (to == kNone) return false;
    moves_.emplace_back(i, to);
  }
  return true;
}

bool RemovedPoints::permits(Vec3d vertex, std::span<const Patch> patches,
                            std::span<const std::uint32_t> gone) {
  moves_.clear();
  vertex_to_ = nearest(vertex, patches);
  if (vertex_to_ == kNone) return false;
  for (const Patch& patch : patches)
    if (!find_nearest(patch.triangle, patches)) return false;
  for (const std::uint32_t triangle : gone)
    if (!find_nearest(triangle, patches)) return false;
  return true;
}

void RemovedPoints::move(Vec3d vertex, std::span<const Patch> patches,
                         std::span<const std::uint32_t> gone) {
  for (const Patch& patch : patches) first_[patch.triangle] = kNone;
  for (const std::uint32_t triangle : gone) first_[triangle] = kNone;
  for (const auto& [i, to] : moves_) {
    points_[i].next = first_[to];
    first_[to] = i;
  }
  add(vertex, vertex_to_);
}

}  // namespace isobrick
