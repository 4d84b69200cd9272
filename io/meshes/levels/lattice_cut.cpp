#include "io/meshes/levels/lattice_cut.h"

#include <algorithm>
#include <utility>

namespace isobrick::inline v0 {
namespace {

struct Range {
  std::int64_t lo, hi;
};

Range range_along(const LatticeTriangle& t, std::size_t axis) {
  const auto [lo, hi] = std::minmax({t[0][axis], t[1][axis], t[2][axis]});
  return {lo, hi};
}

/// The rounded quotient of numbers above 0.
std::int64_t divide_rounded(std::int64_t a, std::int64_t b) { return (a + b / 2) / b; }

/// Where the side between two points meets a plane between them: the same point from both ends.
LatticePoint meet(LatticePoint a, LatticePoint b, std::size_t axis, std::int64_t plane) {
  if (b < a) std::swap(a, b);
  const std::int64_t whole = b[axis] - a[axis], part = plane - a[axis];
  LatticePoint point;
  for (std::size_t i = 0; i < 3; ++i) {
    const std::int64_t way = (b[i] - a[i]) * (whole < 0 ? -part : part);
    const std::int64_t length = whole < 0 ? -whole : whole;
    point[i] = a[i] + (way < 0 ? -divide_rounded(-way, length) : divide_rounded(way, length));
  }
  point[axis] = plane;
  return point;
}

bool has_three_corners(const LatticeTriangle& t) {
  return t[0] != t[1] && t[1] != t[2] && t[2] != t[0];
}

void add_piece(std::vector<LatticeTriangle>& pieces, const LatticeTriangle& piece) {
  if (has_three_corners(piece)) pieces.push_back(piece);
}

/// Adds a polygon of three or four corners.
void add_polygon(std::vector<LatticeTriangle>& pieces, const LatticePoint* corners,
                 std::size_t count) {
  for (std::size_t i = 2; i < count; ++i)
    add_piece(pieces, {corners[0], corners[i - 1], corners[i]});
}

/// Parts a triangle with corners on both sides of a plane.
void part(const LatticeTriangle& t, std::size_t axis, std::int64_t plane,
          std::vector<LatticeTriangle>& below, std::vector<LatticeTriangle>& above) {
  LatticePoint low[4], high[4];
  std::size_t lows = 0, highs = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    const LatticePoint &a = t[i], &b = t[(i + 1) % 3];
    if (a[axis] <= plane) low[lows++] = a;
    if (a[axis] >= plane) high[highs++] = a;
    if ((a[axis] < plane && b[axis] > plane) || (a[axis] > plane && b[axis] < plane))
      low[lows++] = high[highs++] = meet(a, b, axis, plane);
  }
  add_polygon(below, low, lows);
  add_polygon(above, high, highs);
}

}  // namespace

LatticeCut::LatticeCut(const ChunkGrid& grid, int level) : halves_(level > 0 ? 2 : 1) {
  for (int axis = 0; axis < 3; ++axis)
    last_[static_cast<std::size_t>(axis)] =
        std::int64_t{grid.count(axis, level)} * std::int64_t{halves_} - 1;
}

std::int64_t LatticeCut::plane(std::int64_t cell) const {
  if (halves_ == 1) return cell * ChunkGrid::kSteps;
  return cell / 2 * ChunkGrid::kSteps + cell % 2 * ChunkGrid::kMiddle;
}

std::int64_t LatticeCut::cell_at(std::int64_t place) const {
  const std::int64_t chunk = place / ChunkGrid::kSteps;
  if (halves_ == 1) return chunk;
  return 2 * chunk + (place % ChunkGrid::kSteps >= ChunkGrid::kMiddle ? 1 : 0);
}

void LatticeCut::cut_along(std::size_t axis) {
  to_.clear();
  while (!from_.empty()) {
    const LatticeTriangle t = from_.back();
    from_.pop_back();
    const Range range = range_along(t, axis);
    const std::int64_t next = plane(cell_at(range.lo) + 1);
    if (next >= range.hi)
      to_.push_back(t);
    else
      part(t, axis, next, to_, from_);
  }
  std::swap(from_, to_);
}

const std::vector<LatticeTriangle>& LatticeCut::pieces_of(const LatticeTriangle& triangle) {
  from_.clear();
  add_piece(from_, triangle);
  for (std::size_t axis = 0; axis < 3; ++axis) cut_along(axis);
  return from_;
}

GridCell LatticeCut::cell_of(const LatticeTriangle& piece) const {
  GridCell cell;
  for (std::size_t axis = 0; axis < 3; ++axis)
    cell[axis] =
        static_cast<std::uint32_t>(std::min(last_[axis], cell_at(range_along(piece, axis).lo)));
  return cell;
}

void LatticeCut::range_of(const LatticeTriangle& triangle, std::size_t axis, std::uint32_t& lo,
                          std::uint32_t& hi) const {
  const Range range = range_along(triangle, axis);
  const std::int64_t last = last_[axis] / halves_;
  const std::int64_t first = std::min(last, range.lo / ChunkGrid::kSteps);
  lo = static_cast<std::uint32_t>(first);
  // What ends on a face is before it, unless it lies in the face.
  hi = static_cast<std::uint32_t>(std::max(first, (range.hi - 1) / ChunkGrid::kSteps));
}

}  // namespace isobrick
