#include "isobrick/viewer/node_border.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace isobrick {
namespace {

/// A cell of a face: corners (0,0), (1,0), (0,1), (1,1), edges bottom, right,
/// top, left. Values are differences from the isovalue.
struct FaceCell {
  float v[4];
  bool inside(int corner) const { return v[corner] >= 0; }
  bool crosses(int edge) const { return inside(kEnds[edge][0]) != inside(kEnds[edge][1]); }
  bool ambiguous() const {
    return inside(0) == inside(3) && inside(1) == inside(2) && inside(0) != inside(1);
  }
  /// Where the contour crosses an edge.
  std::array<double, 2> crossing(int edge) const {
    const double a = v[kEnds[edge][0]], b = v[kEnds[edge][1]];
    const double t = std::isinf(a - b) ? 0.5 : a / (a - b);
    switch (edge) {
      case 0: return {t, 0};
      case 1: return {1, t};
      case 2: return {t, 1};
      default: return {0, t};
    }
  }
  /// The edge at the other end of the contour that crosses `edge`: around an
  /// outside corner where there are two (the inside stays connected).
  int partner(int edge) const {
    if (!ambiguous()) {
      for (int other = 0; other < 4; ++other)
        if (other != edge && crosses(other)) return other;
      return edge;
    }
    constexpr int kAround[4][2] = {{0, 3}, {0, 1}, {2, 3}, {1, 2}};  // edges at a corner
    for (int corner = 0; corner < 4; ++corner)
      if (!inside(corner)) {
        if (kAround[corner][0] == edge) return kAround[corner][1];
        if (kAround[corner][1] == edge) return kAround[corner][0];
      }
    return edge;
  }
  static constexpr int kEnds[4][2] = {{0, 1}, {1, 3}, {2, 3}, {0, 2}};
};

/// The point of the segment nearest to p, and its distance squared.
struct Nearest {
  std::array<double, 2> point;
  double distance2;
};
Nearest nearest_on(std::array<double, 2> a, std::array<double, 2> b, std::array<double, 2> p) {
  const double dx = b[0] - a[0], dy = b[1] - a[1], length2 = dx * dx + dy * dy;
  const double t =
      length2 > 0 ? std::clamp(((p[0] - a[0]) * dx + (p[1] - a[1]) * dy) / length2, 0.0, 1.0) : 0;
  const std::array<double, 2> q{a[0] + t * dx, a[1] + t * dy};
  return {q, (q[0] - p[0]) * (q[0] - p[0]) + (q[1] - p[1]) * (q[1] - p[1])};
}

/// The axes along a face.
constexpr int first_axis(int normal) { return normal == 0 ? 1 : 0; }
constexpr int second_axis(int normal) { return normal == 2 ? 1 : 2; }

/// Whether direction i is among those of a face in `mask`, or of an edge.
bool on_larger(std::uint32_t mask, int i) {
  const Int3 d = direction(i);
  for (int j = 0; j < kDirections; ++j) {
    if (j == i || !(mask >> j & 1)) continue;
    const Int3 e = direction(j);
    bool part = true;
    for (int axis = 0; axis < 3; ++axis) part &= e[axis] == 0 || e[axis] == d[axis];
    if (part) return true;
  }
  return false;
}

}  // namespace

NodeBorder::Between NodeBorder::between(int axis, Index point) const {
  const Index r = ratio_[axis], first = point / r;
  if (point % r == 0) return {first, 0};
  const auto at = [&](int level, Index p) {
    return static_cast<double>(grid_.position(level, axis, p));
  };
  const double a = at(key_.level + 1, first), b = at(key_.level + 1, first + 1);
  const double weight = (at(key_.level, point) - a) / (b - a);
  return weight < 1 ? Between{first, weight} : Between{first + 1, 0};
}

float NodeBorder::interpolated(const GridValues& coarse, Int3 point) const {
  Between b[3];
  for (int axis = 0; axis < 3; ++axis) b[axis] = between(axis, point[axis]);
  const auto mix = [](float u, float v, double w) { return u + static_cast<float>(w) * (v - u); };
  const auto along_x = [&](Index y, Index z) {
    const float u = coarse.at({b[0].first, y, z});
    return b[0].weight > 0 ? mix(u, coarse.at({b[0].first + 1, y, z}), b[0].weight) : u;
  };
  const auto along_y = [&](Index z) {
    const float u = along_x(b[1].first, z);
    return b[1].weight > 0 ? mix(u, along_x(b[1].first + 1, z), b[1].weight) : u;
  };
  const float u = along_y(b[2].first);
  return b[2].weight > 0 ? mix(u, along_y(b[2].first + 1), b[2].weight) : u;
}

void NodeBorder::apply(const NodeKey& key, std::uint32_t coarser, double isovalue,
                       const Wanted& wanted, GridValues& field) {
  key_ = key;
  ratio_ = grid_.ratio(key.level);
  lo_ = field.points.lo;
  hi_ = field.points.hi - Int3{1, 1, 1};
  for (auto& face : faces_) face.reset();
  for (int i = 0; i < kDirections; ++i)
    if (coarser >> i & 1 && !on_larger(coarser, i)) take_values(i, isovalue, wanted, field);
}

void NodeBorder::take_values(int i, double isovalue, const Wanted& wanted, GridValues& field) {
  const Int3 d = direction(i);
  Box3 points, coarse;
  int normal = 0, fixed = 0;
  for (int axis = 0; axis < 3; ++axis) {
    points.lo[axis] = d[axis] > 0 ? hi_[axis] : lo_[axis];
    points.hi[axis] = (d[axis] < 0 ? lo_[axis] : hi_[axis]) + 1;
    const Between first = between(axis, points.lo[axis]);
    const Between last = between(axis, points.hi[axis] - 1);
    coarse.lo[axis] = first.first;
    coarse.hi[axis] = last.first + (last.weight > 0 ? 2 : 1);
    if (d[axis] != 0) {
      normal = axis;
      ++fixed;
    }
  }
  samples_.read(key_.level + 1, coarse, isovalue, wanted, scratch_);
  for_each_point(points, [&](Int3 p) { field.at(p) = interpolated(scratch_, p); });
  if (fixed != 1) return;
  const int face = 2 * normal + (d[normal] > 0);
  faces_[static_cast<std::size_t>(face)] = scratch_;
  connect_inside(face, field);
}

/// Where the coarser side has an ambiguous cell it connects the inside; the finer
/// side does the same when the middle of that cell is inside. Clearly so: at the isovalue
/// itself the vertices around the middle would be in one place.
void NodeBorder::connect_inside(int face, GridValues& field) const {
  const int normal = face / 2, u = first_axis(normal), v = second_axis(normal);
  if (ratio_[u] != 2 || ratio_[v] != 2) return;
  const GridValues& coarse = *faces_[static_cast<std::size_t>(face)];
  for (Index j = coarse.points.lo[v]; j + 1 < coarse.points.hi[v]; ++j)
    for (Index i = coarse.points.lo[u]; i + 1 < coarse.points.hi[u]; ++i) {
      FaceCell cell{};
      for (int c = 0; c < 4; ++c) {
        Int3 p = coarse.points.lo;
        p[u] = i + (c & 1);
        p[v] = j + (c >> 1);
        cell.v[c] = coarse.at(p);
      }
      if (!cell.ambiguous()) continue;
      Int3 middle = face % 2 ? hi_ : lo_;
      middle[u] = 2 * i + 1;
      middle[v] = 2 * j + 1;
      // A cell that is cut short by the volume's border may have no middle.
      if (middle[u] >= hi_[u] || middle[v] >= hi_[v]) continue;
      if (field.at(middle) < 0)
        field.at(middle) =
            std::min(std::max(cell.v[0], cell.v[1]), std::max(cell.v[2], cell.v[3])) / 2;
    }
}

/// Whether a coordinate lies strictly between two coarse grid points.
bool NodeBorder::interior(int axis, Index below, double part) const {
  return part > 0 || between(axis, below).weight > 0;
}

Vec3d NodeBorder::moved(int face, Int3 below, Vec3d part, Vec3d place) const {
  const auto& coarse = faces_[static_cast<std::size_t>(face)];
  const int normal = face / 2, axes[2] = {first_axis(normal), second_axis(normal)};
  if (!coarse || !interior(axes[0], below[axes[0]], part[axes[0]]) ||
      !interior(axes[1], below[axes[1]], part[axes[1]]))
    return place;
  Int3 corner = coarse->points.lo;
  std::array<double, 2> at{}, from{}, length{};
  int half[2] = {-1, -1};  // on which side of a cell's middle, along the axis of the vertex's edge
  for (std::size_t k = 0; k < 2; ++k) {
    const int axis = axes[k];
    corner[axis] = below[axis] / ratio_[axis];
    from[k] = static_cast<double>(grid_.position(key_.level + 1, axis, corner[axis]));
    length[k] =
        static_cast<double>(grid_.position(key_.level + 1, axis, corner[axis] + 1)) - from[k];
    at[k] = (place[axis] - from[k]) / length[k];
    if (part[axis] > 0 && ratio_[axis] == 2) half[k] = static_cast<int>(below[axis] % 2);
  }
  FaceCell cell{};
  for (int c = 0; c < 4; ++c) {
    Int3 p = corner;
    p[axes[0]] += c & 1;
    p[axes[1]] += c >> 1;
    cell.v[c] = coarse->at(p);
  }
  // The vertex's edge goes from the cell's middle to that of one of its edges; the
  // contour that crosses it ends on that edge where there is a choice.
  int near = half[1] >= 0 ? (half[1] ? 2 : 0) : half[0] >= 0 ? (half[0] ? 1 : 3) : -1;
  if (!cell.ambiguous()) near = -1;
  Nearest best{at, std::numeric_limits<double>::infinity()};
  for (int edge = 0; edge < 4; ++edge) {
    if (!cell.crosses(edge) || (near >= 0 && edge != near)) continue;
    const Nearest found = nearest_on(cell.crossing(edge), cell.crossing(cell.partner(edge)), at);
    if (found.distance2 < best.distance2) best = found;
  }
  for (std::size_t k = 0; k < 2; ++k) place[axes[k]] = from[k] + best.point[k] * length[k];
  return place;
}

}  // namespace isobrick
