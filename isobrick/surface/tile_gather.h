#pragma once

#include "isobrick/surface/tile_state.h"

namespace isobrick {

/// Copies the samples that the tile's active blocks need, `reach` layers around
/// them included, from the bricks that hold them. Absent bricks give `fill`.
void gather_tile(const Lattice& lattice, const BrickLookup& bricks, double fill, Index reach,
                 TileState& tile);

}  // namespace isobrick
