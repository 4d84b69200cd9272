#include "io/meshes/levels/chunk_lattice.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace isobrick::inline v0 {
namespace {

/// Fragments along an axis: 2¹⁵, so that three numbers make a key of 64 bits with room to spare.
constexpr double kMaxCells = 32768;

}  // namespace

std::uint32_t ChunkGrid::count(int axis, int level) const {
  const std::uint32_t all = cells[static_cast<std::size_t>(axis)];
  return std::max<std::uint32_t>(1, (all + (1U << level) - 1) >> level);
}

double ChunkGrid::edge_of(int level) const { return std::ldexp(double{edge}, level); }

LatticePoint ChunkGrid::quantize(const Vec3f& position, int level) const {
  const double steps = static_cast<double>(kSteps) / edge_of(level);
  LatticePoint point;
  for (int axis = 0; axis < 3; ++axis) {
    const auto i = static_cast<std::size_t>(axis);
    const double at = std::round((double{position[axis]} - double{origin[i]}) * steps);
    const std::int64_t last = kSteps * std::int64_t{count(axis, level)};
    // Not a number becomes 0.
    point[i] = at > 0 ? std::min(last, static_cast<std::int64_t>(std::min(at, 1e15))) : 0;
  }
  return point;
}

int ChunkGrid::levels() const {
  const std::uint32_t longest = *std::ranges::max_element(cells);
  int level = 0;
  while ((longest - 1) >> level > 0) ++level;
  return level + 1;
}

ChunkGrid make_chunk_grid(const MeshBounds& bounds, double edge) {
  ChunkGrid grid;
  double longest = 0, largest = 0;
  for (int axis = 0; axis < 3; ++axis) {
    float& lo = grid.origin[static_cast<std::size_t>(axis)];
    lo = static_cast<float>(bounds.lo[axis]);
    longest = std::max(longest, bounds.hi[axis] - double{lo});
    largest = std::max({largest, std::abs(bounds.lo[axis]), std::abs(bounds.hi[axis])});
  }
  // A flat mesh, or one of a point, far away: what floats tell apart there.
  const double least = std::max(largest * 1e-6, double{std::numeric_limits<float>::min()});
  longest = std::max(longest, least);
  const double cells = std::clamp(std::ceil(longest / std::max(edge, least)), 1.0, kMaxCells);
  grid.edge = static_cast<float>(longest / cells);
  while (double{grid.edge} * cells < longest)
    grid.edge = std::nextafter(grid.edge, std::numeric_limits<float>::infinity());
  for (int axis = 0; axis < 3; ++axis) {
    const auto i = static_cast<std::size_t>(axis);
    const double extent = bounds.hi[axis] - double{grid.origin[i]};
    grid.cells[i] = static_cast<std::uint32_t>(
        std::clamp(std::ceil(extent / double{grid.edge}), 1.0, kMaxCells));
  }
  return grid;
}

}  // namespace isobrick
