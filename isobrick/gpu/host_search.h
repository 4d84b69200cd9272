#pragma once

#include <vector>

#include "isobrick/core/range.h"
#include "isobrick/core/vec.h"
#include "isobrick/gpu/tile_params.h"

namespace isobrick::gpu {

/// Which of a few tiles an isovalue stabs, found by the host: it is done with them in less time
/// than blocks take to ask for ranges.
class HostSearch {
 public:
  using Range = ValueRange<double>;

  /// Of up to kMostCandidates tiles; those with an empty range are never active.
  HostSearch(const std::vector<Int3>& tiles, const std::vector<Range>& ranges);

  FoundTiles find(double isovalue) const;

 private:
  std::vector<double> lo_, hi_;       ///< of the ranges
  std::vector<std::uint32_t> tiles_;  ///< packed
};

}  // namespace isobrick::gpu
