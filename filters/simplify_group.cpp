#include "filters/simplify_group.h"

#include <meshoptimizer.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/vectors.h"

namespace isobrick::inline v0 {
namespace {

/// Of a simplification without a limit, relative to the extent.
constexpr double kAnyError = 1e10;
/// Errors that are tried, each half of the one before, and attempts with each.
constexpr int kErrorSteps = 6;
constexpr int kMaxRounds = 8;
/// How much farther than the quadric error a place may move where no distance is given.
constexpr double kMaxExcess = 4;

/// The square of the distance from a point to a triangle: Ericson, Real-time collision detection,
/// 2005, section 5.1.5.
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

/// Triangles by the cells of a grid that their bounding boxes touch.
class TriangleGrid {
 public:
  TriangleGrid(const std::vector<Vec3f>& positions, const std::vector<Triangle>& triangles,
               double distance)
      : positions_(positions), triangles_(triangles) {
    for (const Triangle& t : triangles)
      for (const std::uint32_t v : t) include(to_double(positions[v]));
    if (triangles.empty()) return;
    double longest = 0;
    for (int axis = 0; axis < 3; ++axis) longest = std::max(longest, hi_[axis] - lo_[axis]);
    // About as many cells along an axis as a surface of so many triangles has triangles.
    const double cells = std::clamp(std::sqrt(static_cast<double>(triangles.size())), 1.0, 64.0);
    edge_ = std::max({longest / cells, distance, std::numeric_limits<double>::min()});
    for (int axis = 0; axis < 3; ++axis)
      count_[axis] = static_cast<int>(std::min(64.0, (hi_[axis] - lo_[axis]) / edge_)) + 1;
    fill();
  }

  bool has_within(Vec3d p, double distance) const {
    if (triangles_.empty()) return false;
    int lo[3], hi[3];
    for (int axis = 0; axis < 3; ++axis) {
      lo[axis] = cell(p[axis] - distance, axis);
      hi[axis] = cell(p[axis] + distance, axis);
    }
    const double square = distance * distance;
    for (int z = lo[2]; z <= hi[2]; ++z)
      for (int y = lo[1]; y <= hi[1]; ++y)
        for (int x = lo[0]; x <= hi[0]; ++x)
          for (std::size_t i = begin_[number(x, y, z)]; i < begin_[number(x, y, z) + 1]; ++i) {
            const Triangle& t = triangles_[members_[i]];
            if (squared_distance(p, at(t[0]), at(t[1]), at(t[2])) <= square) return true;
          }
    return false;
  }

 private:
  void include(Vec3d p) {
    for (int axis = 0; axis < 3; ++axis) {
      lo_[axis] = std::min(lo_[axis], p[axis]);
      hi_[axis] = std::max(hi_[axis], p[axis]);
    }
  }
  Vec3d at(std::uint32_t vertex) const { return to_double(positions_[vertex]); }
  int cell(double coordinate, int axis) const {
    return static_cast<int>(
        std::clamp((coordinate - lo_[axis]) / edge_, 0.0, static_cast<double>(count_[axis] - 1)));
  }
  std::size_t number(int x, int y, int z) const {
    return static_cast<std::size_t>((z * count_[1] + y) * count_[0] + x);
  }

  template <class F>
  void for_each_cell(const Triangle& t, F&& f) const {
    int lo[3], hi[3];
    for (int axis = 0; axis < 3; ++axis) {
      const double a = at(t[0])[axis], b = at(t[1])[axis], c = at(t[2])[axis];
      lo[axis] = cell(std::min({a, b, c}), axis);
      hi[axis] = cell(std::max({a, b, c}), axis);
    }
    for (int z = lo[2]; z <= hi[2]; ++z)
      for (int y = lo[1]; y <= hi[1]; ++y)
        for (int x = lo[0]; x <= hi[0]; ++x) f(number(x, y, z));
  }

  void fill() {
    begin_.assign(number(0, 0, count_[2]) + 1, 0);
    for (const Triangle& t : triangles_) for_each_cell(t, [&](std::size_t c) { ++begin_[c + 1]; });
    for (std::size_t c = 1; c < begin_.size(); ++c) begin_[c] += begin_[c - 1];
    members_.resize(begin_.back());
    std::vector<std::size_t> next(begin_.begin(), begin_.end() - 1);
    for (std::size_t i = 0; i < triangles_.size(); ++i)
      for_each_cell(triangles_[i],
                    [&](std::size_t c) { members_[next[c]++] = static_cast<std::uint32_t>(i); });
  }

  const std::vector<Vec3f>& positions_;
  const std::vector<Triangle>& triangles_;
  static constexpr double kFar = std::numeric_limits<double>::infinity();
  Vec3d lo_{kFar, kFar, kFar}, hi_{-kFar, -kFar, -kFar};
  double edge_ = 1;
  int count_[3] = {1, 1, 1};
  std::vector<std::size_t> begin_;      ///< of each cell's members
  std::vector<std::uint32_t> members_;  ///< triangles
};

/// Simplifies the triangles that are not frozen, whose borders stay, and adds those that are.
SimplifiedGroup simplify_rest(const TriangleGroup& group, const std::vector<bool>& is_frozen,
                              std::uint64_t target, double error, double scale) {
  std::vector<Triangle> frozen, rest;
  for (std::size_t i = 0; i < is_frozen.size(); ++i)
    (is_frozen[i] ? frozen : rest).push_back(group.triangles[i]);
  const std::uint64_t left = target > frozen.size() ? target - frozen.size() : 0;
  SimplifiedGroup result;
  if (rest.empty() || left >= rest.size()) return {group.triangles, 0};
  result.triangles.resize(rest.size());
  float relative = 0;
  const std::size_t indices =
      meshopt_simplify(result.triangles.front().data(), rest.front().data(), 3 * rest.size(),
                       reinterpret_cast<const float*>(group.positions.data()),
                       group.positions.size(), sizeof(Vec3f), 3 * static_cast<std::size_t>(left),
                       static_cast<float>(error), meshopt_SimplifyLockBorder, &relative);
  result.triangles.resize(indices / 3);
  result.triangles.insert(result.triangles.end(), frozen.begin(), frozen.end());
  result.quadric_error = static_cast<double>(relative) * scale;
  return result;
}

/// Freezes triangles and all that share a vertex with one.
void freeze_around(const TriangleGroup& group, const std::vector<std::size_t>& triangles,
                   std::vector<bool>& is_frozen) {
  std::vector<bool> is_near(group.positions.size());
  for (const std::size_t i : triangles)
    for (const std::uint32_t v : group.triangles[i]) is_near[v] = true;
  for (std::size_t i = 0; i < is_frozen.size(); ++i)
    for (const std::uint32_t v : group.triangles[i])
      if (is_near[v]) is_frozen[i] = true;
}

/// The simplification to a number of triangles in which places stay that would move much farther
/// than the quadrics say: ends of thin sheets, whose error is lost in that of their faces.
SimplifiedGroup simplify_freely(const TriangleGroup& group, std::uint64_t target, double scale) {
  std::vector<bool> is_frozen(group.triangles.size());
  SimplifiedGroup result = simplify_rest(group, is_frozen, target, kAnyError, scale);
  const double distance = kMaxExcess * result.quadric_error;
  for (int round = 0; round < kMaxRounds; ++round) {
    const std::vector<std::size_t> far =
        far_triangles(group.positions, group.triangles, result.triangles, distance);
    if (far.empty()) break;
    freeze_around(group, far, is_frozen);
    result = simplify_rest(group, is_frozen, target, kAnyError, scale);
  }
  return result;
}

/// The simplification by an error in which what exceeds the distance stays; the whole group where
/// `most` triangles or more would be left.
SimplifiedGroup simplify_within(const TriangleGroup& group, const GroupTarget& target, double error,
                                double scale, std::size_t most) {
  std::vector<bool> is_frozen(group.triangles.size());
  for (int round = 0; round < kMaxRounds; ++round) {
    SimplifiedGroup result = simplify_rest(group, is_frozen, target.triangles, error, scale);
    if (result.triangles.size() >= most) break;
    const std::vector<std::size_t> far =
        far_triangles(group.positions, group.triangles, result.triangles, target.max_distance);
    if (far.empty()) return result;
    freeze_around(group, far, is_frozen);
  }
  return {group.triangles, 0};
}

}  // namespace

std::vector<std::size_t> far_triangles(const std::vector<Vec3f>& positions,
                                       const std::vector<Triangle>& from,
                                       const std::vector<Triangle>& to, double distance) {
  enum class State : std::uint8_t { unknown, near, far };
  const TriangleGrid grid(positions, to, distance);
  std::vector<State> states(positions.size());
  std::vector<std::size_t> found;
  for (std::size_t i = 0; i < from.size(); ++i) {
    Vec3d centre;
    bool is_far = false;
    for (const std::uint32_t v : from[i]) {
      const Vec3d p = to_double(positions[v]);
      centre = centre + p * (1.0 / 3);
      if (states[v] == State::unknown)
        states[v] = grid.has_within(p, distance) ? State::near : State::far;
      is_far |= states[v] == State::far;
    }
    if (is_far || !grid.has_within(centre, distance)) found.push_back(i);
  }
  return found;
}

SimplifiedGroup simplify(const TriangleGroup& group, const GroupTarget& target) {
  const std::vector<Triangle>& all = group.triangles;
  const SimplifiedGroup whole{all, 0};
  if (all.empty() || target.triangles >= all.size()) return whole;
  const double scale = meshopt_simplifyScale(reinterpret_cast<const float*>(group.positions.data()),
                                             group.positions.size(), sizeof(Vec3f));
  if (!(scale > 0)) return whole;
  if (target.is_estimate)
    return simplify_rest(group, std::vector<bool>(all.size()), target.triangles, kAnyError, scale);
  if (!std::isfinite(target.max_distance)) return simplify_freely(group, target.triangles, scale);
  // The quadric error does not bound distances. With less of it fewer places exceed the distance
  // and stay as they are, so less error may leave fewer triangles.
  SimplifiedGroup best = whole;
  double error = target.max_distance / scale;
  for (int step = 0; step < kErrorSteps; ++step, error /= 2) {
    SimplifiedGroup found = simplify_within(group, target, error, scale, best.triangles.size());
    if (found.triangles.size() < best.triangles.size())
      best = std::move(found);
    else if (best.triangles.size() < all.size())
      break;
  }
  return best;
}

}  // namespace isobrick
