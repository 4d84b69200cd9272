#include "viewer/scene/node_grid.h"

#include <algorithm>
#include <cmath>

#include <isobrick/error.h>

namespace isobrick::inline v0 {
namespace {

/// Components along the volume's own axes.
Vec3d turned_back(const Transform& t, Vec3d v) {
  const auto& d = t.direction;
  return {d[0] * v.x + d[3] * v.y + d[6] * v.z, d[1] * v.x + d[4] * v.y + d[7] * v.z,
          d[2] * v.x + d[5] * v.y + d[8] * v.z};
}

void check_direction(const StoreInfo& info, const Transform& t) {
  for (std::size_t i = 0; i < 9; ++i)
    if (std::abs(t.direction[i] - info.levels.front().transform.direction[i]) > 1e-6)
      throw Error("'" + info.name +
                  "': levels that lie at different angles cannot be shown together");
}

/// Powers of two by which a level is coarser than level 0.
Int3 exponents_of(const Transform& finest, const Transform& t) {
  Int3 e;
  for (int axis = 0; axis < 3; ++axis) {
    const double ratio = std::abs(t.spacing[axis] / finest.spacing[axis]);
    e[axis] = std::clamp<Index>(std::lround(std::log2(ratio)), 0, 40);
  }
  return e;
}

constexpr Index power(Index e) { return Index{1} << e; }

/// Maximum cells along each axis of the coarsest level.
constexpr Index kFewCells = 16;
/// Levels above a stored one read all of its samples, so it must be small.
constexpr Index kFewSamples = Index{1} << 24;

}  // namespace

NodeGrid::NodeGrid(const StoreInfo& info) : transform_(info.levels.front().transform) {
  cells_ = info.levels.front().lattice.extent - Int3{1, 1, 1};
  for (const LevelInfo& level : info.levels) stored_extents_.push_back(level.lattice.extent);
  Int3 exponents;
  add_levels(info, 0, exponents);
  for (std::size_t i = 1; i < info.levels.size(); ++i)
    add_levels(info, static_cast<int>(i), exponents);
  coarsest_stored_ = levels() - 1;
  const Int3 coarsest = stored_extents_[static_cast<std::size_t>(levels_.back().source)];
  if (volume(coarsest) <= kFewSamples) add_levels_above(info, exponents);
}

/// If a stored level is more than twice as coarse as the previous one, levels between them use the
/// previous one's samples.
void NodeGrid::add_levels(const StoreInfo& info, int source, Int3& exponents) {
  const Transform& t = info.levels[static_cast<std::size_t>(source)].transform;
  check_direction(info, t);
  const Int3 target = max(exponents_of(transform_, t), exponents);
  if (source > 0 && target == exponents) return;
  do {
    const Int3 below = exponents;
    exponents = min(target, exponents + Int3{1, 1, 1});
    if (!levels_.empty()) halvings_.push_back(exponents - below);
    add_level(info, exponents == target ? source : source - 1, exponents);
  } while (exponents != target);
}

void NodeGrid::add_levels_above(const StoreInfo& info, Int3& exponents) {
  for (;;) {
    Int3 halved;
    for (int axis = 0; axis < 3; ++axis) halved[axis] = levels_.back().cells[axis] > kFewCells;
    if (halved == Int3{}) return;
    exponents = exponents + halved;
    halvings_.push_back(halved);
    add_level(info, levels_.back().source, exponents);
  }
}

void NodeGrid::add_level(const StoreInfo& info, int source, Int3 exponents) {
  Level level;
  level.source = source;
  const Transform& s = info.levels[static_cast<std::size_t>(source)].transform;
  const Vec3d shift = turned_back(transform_, transform_.origin - s.origin);
  for (int axis = 0; axis < 3; ++axis) {
    level.step[axis] = power(exponents[axis]);
    level.scale[axis] = transform_.spacing[axis] / s.spacing[axis];
    level.offset[axis] = shift[axis] / s.spacing[axis];
    level.spacing = std::max(
        level.spacing, std::abs(transform_.spacing[axis]) * static_cast<double>(level.step[axis]));
  }
  level.cells = ceil_div(cells_, level.step);
  level.nodes = ceil_div(level.cells, {kNodeEdge, kNodeEdge, kNodeEdge});
  if (volume(level.nodes) == 0) level.nodes = {};
  levels_.push_back(level);
}

Int3 NodeGrid::node_cells(const NodeKey& n) const {
  return min({kNodeEdge, kNodeEdge, kNodeEdge}, level(n.level).cells - n.node * kNodeEdge);
}

Index NodeGrid::position(int v, int axis, Index point) const {
  return std::min(point * level(v).step[axis], cells_[axis]);
}

IndexBox NodeGrid::box(const NodeKey& n) const {
  IndexBox box;
  for (int axis = 0; axis < 3; ++axis) {
    box.lo[axis] = static_cast<double>(position(n.level, axis, n.node[axis] * kNodeEdge));
    box.hi[axis] = static_cast<double>(position(n.level, axis, (n.node[axis] + 1) * kNodeEdge));
  }
  return box;
}

Box3 NodeGrid::children(const NodeKey& n) const {
  const Int3 r = ratio(n.level - 1);
  return intersect({n.node * r, (n.node + Int3{1, 1, 1}) * r},
                   {{0, 0, 0}, level(n.level - 1).nodes});
}

NodeGrid::Interpolation NodeGrid::interpolation(int v, int axis, Index point) const {
  const Level& l = level(v);
  const auto last =
      static_cast<double>(stored_extents_[static_cast<std::size_t>(l.source)][axis] - 1);
  const double at = std::clamp(
      l.scale[axis] * static_cast<double>(position(v, axis, point)) + l.offset[axis], 0.0, last);
  // Rounding must not turn a sample into a value between it and its neighbour.
  const double nearest = std::round(at);
  if (std::abs(at - nearest) < 1e-6) return {static_cast<Index>(nearest), 0};
  const double below = std::floor(at);
  return {static_cast<Index>(below), at - below};
}

Box3 NodeGrid::samples(const NodeKey& n) const {
  Box3 box;
  const Int3 cells = node_cells(n);
  for (int axis = 0; axis < 3; ++axis) {
    const Interpolation lo = interpolation(n.level, axis, n.node[axis] * kNodeEdge);
    const Interpolation hi = interpolation(n.level, axis, n.node[axis] * kNodeEdge + cells[axis]);
    box.lo[axis] = lo.first;
    box.hi[axis] = hi.first + (hi.weight > 0 ? 2 : 1);
  }
  return box;
}

Box3 NodeGrid::samples_within(const NodeKey& n, int v) const {
  Box3 box;
  for (int axis = 0; axis < 3; ++axis) {
    const Index step = level(v).step[axis], first = n.node[axis] * kNodeEdge;
    const Index begin = position(n.level, axis, first);
    const Index end = position(n.level, axis, first + kNodeEdge);
    const Interpolation lo = interpolation(v, axis, begin / step);
    const Interpolation hi = interpolation(v, axis, (end + step - 1) / step);
    box.lo[axis] = lo.first + (lo.weight > 0 ? 1 : 0);
    box.hi[axis] = std::max(hi.first, box.lo[axis]) + 1;
  }
  return box;
}

}  // namespace isobrick
