#pragma once

#include <algorithm>
#include <cstddef>

#include <isobrick/vec.h>

namespace isobrick::inline v0 {

/// The largest box with `brick.z` planes to work through a volume in that has
/// at most `samples` samples: whole rows of bricks if one fits, or a part of a
/// row. Its edges are multiples of the brick's; no smaller than one brick.
constexpr Int3 largest_piece(Int3 extent, Int3 brick, std::size_t samples) {
  const Int3 whole = ceil_div(extent, brick) * brick;
  const Index columns = static_cast<Index>(samples) / (brick.y * brick.z);
  const Index rows = columns / whole.x;
  if (rows > 0) return {whole.x, std::min(rows * brick.y, whole.y), brick.z};
  return {std::max(columns / brick.x, Index{1}) * brick.x, brick.y, brick.z};
}

}  // namespace isobrick
