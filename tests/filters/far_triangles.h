#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include <isobrick/mesh.h>
#include "core/vectors.h"
#include "filters/removed_points.h"

namespace isobrick::test {

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

/// The places in `from` of triangles of which a vertex or the centre is farther than `distance`
/// from the triangles `to`, which name the same positions.
inline std::vector<std::size_t> far_triangles(const std::vector<Vec3f>& positions,
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

}  // namespace isobrick::test
