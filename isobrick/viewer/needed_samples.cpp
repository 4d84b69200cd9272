#include "isobrick/viewer/needed_samples.h"

#include <algorithm>

#include "isobrick/viewer/node_grid.h"

namespace isobrick {
namespace {

/// Before and behind a block's first sample: those that its cells or their gradients need.
constexpr Index kBefore = 1, kBehind = kBlockEdge + 2;

/// Whether a block at that place among `blocks` lies beside a neighbour in one of the directions.
bool beside(Int3 block, Box3 blocks, std::uint32_t directions) {
  for (int i = 0; i < kDirections; ++i) {
    if (!(directions >> i & 1)) continue;
    const Int3 d = direction(i);
    bool meets = true;
    for (int axis = 0; axis < 3; ++axis)
      meets &= d[axis] == 0 || block[axis] == (d[axis] < 0 ? blocks.lo[axis] : blocks.hi[axis] - 1);
    if (meets) return true;
  }
  return false;
}

}  // namespace

NeededSamples::NeededSamples(Box3 samples, const RangeTable& table, double isovalue,
                             std::uint32_t coarser)
    : blocks_{floor_div(samples.lo, {kBlockEdge, kBlockEdge, kBlockEdge}),
              ceil_div(samples.hi - Int3{1, 1, 1}, {kBlockEdge, kBlockEdge, kBlockEdge})} {
  for_each_point(blocks_, [&](Int3 b) {
    const ValueRange<double>& range = table.at(b);
    const bool needed = range.empty() || range.stabbed_by(isovalue) || beside(b, blocks_, coarser);
    sides_.push_back(needed ? 0.0f : range.lo < isovalue ? -1.0f : 1.0f);
  });
}

bool NeededSamples::any(Box3 part) const {
  bool found = false;
  std::size_t i = 0;
  for_each_point(blocks_, [&](Int3 b) {
    const Int3 first = b * kBlockEdge;
    const Box3 around{first - Int3{kBefore, kBefore, kBefore},
                      first + Int3{kBehind, kBehind, kBehind}};
    found |= sides_[i++] == 0 && !intersect(around, part).empty();
  });
  return found;
}

/// Those of the border take the side of the node's own block beside them.
void NeededSamples::fill(Box3 part, float* to, Int3 to_extent) const {
  const auto block = [&](int axis, Index p) {
    return std::clamp(p / kBlockEdge, blocks_.lo[axis], blocks_.hi[axis] - 1);
  };
  const Int3 n = blocks_.extent();
  for (Index z = part.lo.z; z < part.hi.z; ++z)
    for (Index y = part.lo.y; y < part.hi.y; ++y) {
      const Int3 row{blocks_.lo.x, block(1, y), block(2, z)};
      const float* sides = &sides_[static_cast<std::size_t>(linear_index(row - blocks_.lo, n))];
      float* out = to + ((z - part.lo.z) * to_extent.y + (y - part.lo.y)) * to_extent.x;
      for (Index x = part.lo.x; x < part.hi.x; ++x) *out++ = sides[block(0, x) - blocks_.lo.x];
    }
}

}  // namespace isobrick
