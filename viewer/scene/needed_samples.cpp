#include "viewer/scene/needed_samples.h"

#include "viewer/scene/node_grid.h"

namespace isobrick::inline v0 {
namespace {

/// Samples before and after a block's first sample that its cells or their gradients need.
constexpr Index kBefore = 1, kAfter = kBlockEdge + 2;

/// Whether the block at `block` among `blocks` lies beside a neighbour in the mask.
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
    sides_.push_back(needed ? Side::needed : range.lo < isovalue ? Side::below : Side::above);
  });
}

bool NeededSamples::any(Box3 part) const {
  bool found = false;
  std::size_t i = 0;
  for_each_point(blocks_, [&](Int3 b) {
    const Int3 first = b * kBlockEdge;
    const Box3 around{first - Int3{kBefore, kBefore, kBefore},
                      first + Int3{kAfter, kAfter, kAfter}};
    found |= sides_[i++] == Side::needed && !intersect(around, part).empty();
  });
  return found;
}

}  // namespace isobrick
