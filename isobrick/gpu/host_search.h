#pragma once

#include <cstddef>
#include <vector>

#include "isobrick/core/range.h"
#include "isobrick/core/vec.h"
#include "isobrick/gpu/tile_params.h"
#include "isobrick/index/index_kind.h"

namespace isobrick::gpu {

/// Which of a few tiles an isovalue stabs, found by the host: it is done with them in less time
/// than blocks take to ask for ranges, or than a launch takes that searches an index.
class HostSearch {
 public:
  using Range = ValueRange<double>;

  /// Of up to kMostCandidates tiles in Morton order, the ends of whose ranges are floats; those
  /// with an empty range are never active.
  HostSearch(const std::vector<Int3>& tiles, const std::vector<Range>& ranges);
  /// The same through an index, of up to kMostThroughIndex; `grid` is how many tiles there are
  /// along each axis.
  HostSearch(const std::vector<Int3>& tiles, const std::vector<Range>& ranges, IndexKind kind,
             Int3 grid);

  FoundTiles find(double isovalue) const;

 private:
  void compare_ranges(double isovalue, FoundTiles& found) const;
  void ask_index(double isovalue, FoundTiles& found) const;

  std::size_t count_;
  std::vector<float> lo_, hi_;         ///< of the ranges
  std::vector<std::uint32_t> packed_;  ///< the tiles, where there are so few that slabs share them
  std::vector<std::byte> index_;       ///< or empty
  std::vector<std::uint32_t> places_;  ///< of the index's ids in Morton order; empty: the same
};

}  // namespace isobrick::gpu
