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

Range range_along(const CutTriangle& t, std::size_t axis) {
  const auto [lo, hi] = std::minmax({t[0].at[axis], t[1].at[axis], t[2].at[axis]});
  return {lo, hi};
}

/// The rounded quotient of numbers above 0.
std::int64_t divide_rounded(std::int64_t a, std::int64_t b) { return (a + b / 2) / b; }

/// Where the side between two corners meets a plane between them: the same from both ends.
LatticeCorner meet(const LatticeCorner& from, const LatticeCorner& to, std::size_t axis,
                   std::int64_t plane) {
  const bool swaps = to.at < from.at;
  const LatticeCorner &a = swaps ? to : from, &b = swaps ? from : to;
  const std::int64_t whole = b.at[axis] - a.at[axis], part = plane - a.at[axis];
  const std::int64_t length = whole < 0 ? -whole : whole;
  LatticeCorner corner;
  for (std::size_t i = 0; i < 3; ++i) {
    const std::int64_t way = (b.at[i] - a.at[i]) * (whole < 0 ? -part : part);
    corner.at[i] =
        a.at[i] + (way < 0 ? -divide_rounded(-way, length) : divide_rounded(way, length));
  }
  corner.at[axis] = plane;
  const float share = static_cast<float>(part) / static_cast<float>(whole);
  corner.normal = a.normal + (b.normal - a.normal) * share;
  return corner;
}

bool has_three_corners(const CutTriangle& t) {
  return t[0].at != t[1].at && t[1].at != t[2].at && t[2].at != t[0].at;
}

void add_piece(std::vector<CutTriangle>& pieces, const CutTriangle& piece) {
  if (has_three_corners(piece)) pieces.push_back(piece);
}

/// Adds a polygon of three or four corners.
void add_polygon(std::vector<CutTriangle>& pieces, const LatticeCorner* corners,
                 std::size_t count) {
  for (std::size_t i = 2; i < count; ++i)
    add_piece(pieces, {corners[0], corners[i - 1], corners[i]});
}

/// Parts a triangle with corners on both sides of a plane.
void part(const CutTriangle& t, std::size_t axis, std::int64_t plane,
          std::vector<CutTriangle>& below, std::vector<CutTriangle>& above) {
  LatticeCorner low[4], high[4];
  std::size_t lows = 0, highs = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    const LatticeCorner &a = t[i], &b = t[(i + 1) % 3];
    const std::int64_t at = a.at[axis], next = b.at[axis];
    if (at <= plane) low[lows++] = a;
    if (at >= plane) high[highs++] = a;
    if ((at < plane && next > plane) || (at > plane && next < plane))
      low[lows++] = high[highs++] = meet(a, b, axis, plane);
  }
  add_polygon(below, low, lows);
  add_polygon(above, high, highs);
}

}  // namespace

LatticeCut::LatticeCut(const ChunkGrid& grid, int level, bool has_halves)
    : halves_(level > 0 && has_halves ? 2 : 1) {
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
    const CutTriangle t = from_.back();
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

const std::vector<CutTriangle>& LatticeCut::pieces_of(const CutTriangle& triangle) {
  from_.clear();
  add_piece(from_, triangle);
  for (std::size_t axis = 0; axis < 3; ++axis) cut_along(axis);
  return from_;
}

GridCell LatticeCut::cell_of(const CutTriangle& piece) const {
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
