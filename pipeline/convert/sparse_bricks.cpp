#include "pipeline/convert/sparse_bricks.h"

#include <algorithm>
#include <utility>

namespace isobrick::inline v0 {
namespace {

/// Calls f(brick) for those that are not known to be the fill value, found by halving a box
/// of bricks again and again.
template <class F>
void visit(const VolumeSource& source, const Lattice& lattice, Int3 first, Index edge, const F& f) {
  const Box3 bricks =
      intersect({first, first + Int3{edge, edge, edge}}, {{0, 0, 0}, lattice.bricks()});
  if (bricks.empty()) return;
  if (source.is_fill(
          intersect({bricks.lo * lattice.brick, bricks.hi * lattice.brick}, lattice.box())))
    return;
  if (edge == 1) return f(first);
  for_each_point({{0, 0, 0}, {2, 2, 2}}, [&](Int3 half) {
    visit(source, lattice, first + half * (edge / 2), edge / 2, f);
  });
}

template <class F>
void visit_all(const VolumeSource& source, const Lattice& lattice, const F& f) {
  const Int3 bricks = lattice.bricks();
  Index edge = 1;
  while (edge < std::max({bricks.x, bricks.y, bricks.z})) edge *= 2;
  visit(source, lattice, {0, 0, 0}, edge, f);
}

}  // namespace

SparseBricks::SparseBricks(std::vector<SparseBrick> bricks, Int3 factors)
    : bricks_(std::move(bricks)), factors_(factors) {
  std::sort(bricks_.begin(), bricks_.end(), [this](const SparseBrick& a, const SparseBrick& b) {
    return order_of(a.brick) < order_of(b.brick);
  });
}

std::span<const SparseBrick> SparseBricks::family_at(std::size_t first) const {
  std::size_t end = first;
  while (end < bricks_.size() && parent_of(bricks_[end].brick) == parent_of(bricks_[first].brick))
    ++end;
  return std::span(bricks_).subspan(first, end - first);
}

std::size_t SparseBricks::families() const {
  std::size_t count = 0;
  for (std::size_t at = 0; at < bricks_.size(); at += family_at(at).size()) ++count;
  return count;
}

bool SparseBricks::contains(Int3 brick) const {
  const auto at = std::lower_bound(
      bricks_.begin(), bricks_.end(), brick,
      [this](const SparseBrick& a, Int3 b) { return order_of(a.brick) < order_of(b); });
  return at != bricks_.end() && at->brick == brick;
}

std::size_t count_sparse_bricks(const VolumeSource& source, const Lattice& lattice) {
  std::size_t count = 0;
  visit_all(source, lattice, [&](Int3) { ++count; });
  return count;
}

std::vector<SparseBrick> find_sparse_bricks(const VolumeSource& source, const Lattice& lattice,
                                            std::size_t count) {
  std::vector<SparseBrick> found;
  found.reserve(count);
  visit_all(source, lattice, [&](Int3 brick) { found.push_back({brick}); });
  return found;
}

}  // namespace isobrick
