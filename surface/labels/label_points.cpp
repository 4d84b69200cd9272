#include "surface/labels/label_points.h"

#include <algorithm>
#include <bit>

#include "surface/case_rule.h"

namespace isobrick::inline v0 {
namespace {

/// The point of a cell, by its edges of different ends.
struct FirstPoints {
  std::array<Vec3f, 4096> of;

  FirstPoints() {
    for (std::size_t mask = 0; mask < of.size(); ++mask) {
      Vec3f sum;
      for (int edge = 0; edge < 12; ++edge) {
        if (!(mask >> edge & 1)) continue;
        const int corner = low_corner(edge);
        Vec3f middle{static_cast<float>(corner & 1), static_cast<float>(corner >> 1 & 1),
                     static_cast<float>(corner >> 2)};
        middle[edge / 4] = 0.5f;
        sum = sum + middle;
      }
      const auto count = static_cast<float>(std::max(1, std::popcount(mask)));
      of[mask] = {sum.x / count, sum.y / count, sum.z / count};
    }
  }
};

/// The edges of each face, as bits.
constexpr std::array<int, 6> edges_of_faces() {
  std::array<int, 6> edges{};
  constexpr auto faces = case_rule::faces_of_edges();
  for (std::size_t edge = 0; edge < 12; ++edge)
    for (std::size_t face = 0; face < 6; ++face)
      if (faces[edge] >> face & 1) edges[face] |= 1 << edge;
  return edges;
}

float within_cell(float p) { return std::min(std::max(p, 0.0f), 1.0f); }

}  // namespace

std::uint64_t LabelPoints::max_bytes(int edge) {
  const auto cells = static_cast<std::uint64_t>(edge) * static_cast<std::uint64_t>(edge) *
                     static_cast<std::uint64_t>(edge);
  // Vectors that grow hold twice as much as they need at most.
  return cells * (sizeof(std::uint32_t) + 2 * (sizeof(std::uint32_t) + sizeof(std::uint16_t) + 1 +
                                               sizeof(Neighbours) + 2 * sizeof(Vec3f)));
}

void LabelPoints::clear() {
  cells_.clear();
  edges_.clear();
  junctions_.clear();
  points_.clear();
}

void LabelPoints::add(int cell, int edges, int junctions) {
  static const FirstPoints first;
  index_of_[static_cast<std::size_t>(cell)] = static_cast<std::uint32_t>(cells_.size());
  cells_.push_back(static_cast<std::uint32_t>(cell));
  edges_.push_back(static_cast<std::uint16_t>(edges));
  junctions_.push_back(static_cast<std::uint8_t>(junctions));
  points_.push_back(first.of[static_cast<std::size_t>(edges)]);
}

void LabelPoints::smooth(const LabelSmoothing& smoothing) {
  if (smoothing.iterations == 0) return;
  find_neighbours();
  // As SmoothStage: the pass band is 1 / λ + 1 / μ.
  constexpr double lambda = 0.6307;
  const double mu = 1 / (smoothing.pass_band - 1 / lambda);
  for (int i = 0; i < smoothing.iterations; ++i) {
    step(static_cast<float>(lambda));
    step(static_cast<float>(mu));
  }
}

/// Cells at the border of the window lack neighbours; what depends on them is not used.
void LabelPoints::find_neighbours() {
  constexpr auto face_edges = edges_of_faces();
  const std::array<int, 3> steps{1, edge_, edge_ * edge_};
  neighbours_.resize(points_.size());
  for (std::size_t i = 0; i < points_.size(); ++i) {
    const auto cell = static_cast<int>(cells_[i]);
    const std::array<int, 3> place{cell % edge_, cell / edge_ % edge_, cell / (edge_ * edge_)};
    // A line that ends in the cell has nowhere to go on.
    const bool on_line = std::popcount(junctions_[i]) > 1;
    for (std::size_t face = 0; face < 6; ++face) {
      const std::size_t axis = face / 2;
      const int direction = face % 2 ? 1 : -1;
      const int at = place[axis] + direction;
      const bool is_near =
          on_line ? junctions_[i] >> face & 1 : (edges_[i] & face_edges[face]) != 0;
      neighbours_[i].of_face[face] =
          is_near && at >= 0 && at < edge_ - 1 ? index_of(cell + direction * steps[axis]) : kNone;
    }
  }
}

/// Moves every point by a part of its way to the mean of its neighbours.
void LabelPoints::step(float factor) {
  moved_.resize(points_.size());
  for (std::size_t i = 0; i < points_.size(); ++i) {
    Vec3f sum;
    float count = 0;
    for (int face = 0; face < 6; ++face) {
      const std::uint32_t index = neighbours_[i].of_face[static_cast<std::size_t>(face)];
      if (index == kNone) continue;
      Vec3f neighbour = points_[index];
      neighbour[face / 2] += face % 2 ? 1.0f : -1.0f;
      sum = sum + neighbour;
      ++count;
    }
    const Vec3f p = points_[i];
    moved_[i] = p;
    if (count == 0) continue;
    for (int axis = 0; axis < 3; ++axis)
      moved_[i][axis] = within_cell(p[axis] + factor * (sum[axis] / count - p[axis]));
  }
  points_.swap(moved_);
}

}  // namespace isobrick
