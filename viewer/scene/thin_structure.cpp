#include "viewer/scene/thin_structure.h"

#include <algorithm>
#include <cmath>
#include <exception>
#include <limits>

#include "viewer/scene/node_samples.h"

namespace isobrick::inline v0 {
namespace {

/// Maximum samples of a stored level that is read: 128³.
constexpr Index kFewSamples = Index{1} << 21;
/// One in so many of the patches that an isovalue crosses may be lost.
constexpr int kSpared = 128;

/// Rounds outwards.
ValueRange<float> in_float(const ValueRange<double>& r) {
  if (r.empty()) return {};
  constexpr float inf = std::numeric_limits<float>::infinity();
  ValueRange<float> out{static_cast<float>(r.lo), static_cast<float>(r.hi)};
  if (static_cast<double>(out.lo) > r.lo) out.lo = std::nextafter(out.lo, -inf);
  if (static_cast<double>(out.hi) < r.hi) out.hi = std::nextafter(out.hi, inf);
  return out;
}

std::size_t patch_index(Int3 patch, Int3 patches) {
  return static_cast<std::size_t>(linear_index(patch, patches));
}

}  // namespace

ThinStructure::ThinStructure(const NodeGrid& grid, const StoreInfo& info) : grid_(grid) {
  for (int v = 1; v < grid.levels(); ++v) {
    const NodeGrid::Level& level = grid.level(v);
    if (volume(level.nodes) == 0 ||
        volume(info.levels[static_cast<std::size_t>(level.source)].lattice.extent) > kFewSamples)
      continue;
    Level& added = levels_.emplace_back();
    added.level = v;
    const bool large = volume(level.nodes) > 1;
    added.edge = max({kBlockEdge, kBlockEdge, kBlockEdge}, level.step * (large ? 4 : 2));
    added.patches = ceil_div(grid.cells(), added.edge);
    added.below.resize(static_cast<std::size_t>(volume(added.patches)));
  }
}

void ThinStructure::include(const RangeTable& table, Box3 blocks) {
  if (levels_.empty()) return;
  Level& finest = levels_.front();
  const Int3 block{kBlockEdge, kBlockEdge, kBlockEdge};
  const Box3 here = intersect(
      {floor_div(blocks.lo * block, finest.edge), ceil_div(blocks.hi * block, finest.edge)},
      {{0, 0, 0}, finest.patches});
  Ranges ranges(static_cast<std::size_t>(volume(here.extent())));
  for_each_point(blocks, [&](Int3 b) {
    const Int3 p = floor_div(b * block, finest.edge);
    if (here.contains(p))
      ranges[patch_index(p - here.lo, here.extent())].include(in_float(table.at(b)));
  });
  // A patch may span several calls, perhaps from several threads.
  const MutexLock lock(mutex_);
  std::size_t i = 0;
  for_each_point(
      here, [&](Int3 p) { finest.below[patch_index(p, finest.patches)].include(ranges[i++]); });
}

void ThinStructure::merge_below() {
  for (std::size_t i = 1; i < levels_.size(); ++i) {
    const Level& finer = levels_[i - 1];
    Level& level = levels_[i];
    std::size_t from = 0;
    for_each_point({{0, 0, 0}, finer.patches}, [&](Int3 p) {
      const Int3 patch = floor_div(p * finer.edge, level.edge);
      level.below[patch_index(patch, level.patches)].include(finer.below[from++]);
    });
  }
}

/// Reads one layer of patches at a time: a whole level may exceed a budget.
ThinStructure::Ranges ThinStructure::own_ranges(const Level& level, NodeSamples& samples,
                                                const CancellationToken& token) const {
  const NodeGrid::Level& grid = grid_.level(level.level);
  const Box3 all{{0, 0, 0}, grid.cells + Int3{1, 1, 1}};
  const Int3 cells = floor_div(level.edge, grid.step);
  const auto around = [&](Int3 lo, Int3 hi) {  // patches
    return intersect({lo * cells - Int3{1, 1, 1}, hi * cells + Int3{2, 2, 2}}, all);
  };
  Ranges own;
  own.reserve(static_cast<std::size_t>(volume(level.patches)));
  GridValues values;
  for (Index z = 0; z < level.patches.z; ++z) {
    const Box3 layer{{0, 0, z}, {level.patches.x, level.patches.y, z + 1}};
    samples.read(level.level, around(layer.lo, layer.hi), 0, token, values);
    for_each_point(layer, [&](Int3 patch) {
      ValueRange<float> range;
      for_each_point(around(patch, patch + Int3{1, 1, 1}),
                     [&](Int3 point) { range.include(values.at(point)); });
      own.push_back(range);
    });
  }
  return own;
}

void ThinStructure::read_levels(ResidentBricks& bricks, const CancellationToken& token) {
  merge_below();
  NodeSamples samples(grid_, bricks);
  for (Level& level : levels_) try {
      level.own = own_ranges(level, samples, token);
    } catch (const OperationCancelled&) {
      throw;
    } catch (const std::exception&) {  // reported when the level is meshed
    }
}

bool ThinStructure::read(ResidentBricks& bricks, const CancellationToken& token) {
  if (levels_.empty() || claimed_.exchange(true)) return false;
  try {
    read_levels(bricks, token);
  } catch (...) {
    claimed_ = false;
    throw;
  }
  known_.store(true, std::memory_order_release);
  return true;
}

bool ThinStructure::lost(const NodeKey& n, double isovalue) const {
  if (!known()) return false;
  const auto found = std::find_if(levels_.begin(), levels_.end(),
                                  [&](const Level& level) { return level.level == n.level; });
  if (found == levels_.end() || found->own.empty()) return false;
  const Int3 node = grid_.level(n.level).step * kNodeEdge;
  const Int3 per_node = floor_div(node, found->edge);
  int crossed = 0, lost = 0;
  for_each_point(
      intersect({n.node * per_node, (n.node + Int3{1, 1, 1}) * per_node}, {{}, found->patches}),
      [&](Int3 p) {
        const std::size_t i = patch_index(p, found->patches);
        if (!found->below[i].stabbed_by(isovalue)) return;
        ++crossed;
        lost += !found->own[i].stabbed_by(isovalue);
      });
  return lost > 0 && lost * kSpared >= crossed;
}

std::uint64_t ThinStructure::bytes() const {
  std::uint64_t bytes = 0;
  for (const Level& level : levels_) bytes += 2 * level.below.capacity() * sizeof(level.below[0]);
  return bytes;
}

}  // namespace isobrick
