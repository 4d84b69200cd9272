#pragma once

#include <cstdint>
#include <vector>

#include "isobrick/bricks/store_reader.h"

namespace isobrick {

/// Which samples a node of the finest level needs, by the ranges of its 16³ blocks: where all
/// samples of a block lie on one side of the isovalue nothing has to be known but the side.
class NeededSamples {
 public:
  /// `samples`: those of the node's cells; `table`: the ranges of the blocks that they lie in, or
  /// of more. A block beside a neighbour in `coarser`, whose values come onto the border, is needed
  /// whatever its range.
  NeededSamples(Box3 samples, const RangeTable& table, double isovalue, std::uint32_t coarser);

  /// Whether any of `part` is needed, as the corner of a cell with a surface or for its gradient.
  bool any(Box3 part) const;
  /// Writes values on the right side of 0 for samples of `part` that are not needed, to rows of
  /// an array of that extent.
  void fill(Box3 part, float* to, Int3 to_extent) const;

 private:
  Box3 blocks_;
  std::vector<float> sides_;  ///< of blocks: a value of its side; 0: needed
};

}  // namespace isobrick
