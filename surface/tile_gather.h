#pragma once

#include "surface/tile_state.h"

namespace isobrick {

/// Where the samples of a tile go: a place for its sample (0, 0, 0), and how far its rows
/// and planes are apart, all counted in samples.
struct TileBlock {
  std::byte* samples;
  Index origin, row, plane;
};

/// Copies the samples that the tile's active blocks need, `reach` layers around
/// them included, from the bricks that hold them. Absent bricks give `fill`.
void gather_samples(const Lattice& lattice, const BrickLookup& bricks, double fill, Index reach,
                    const TileWork& work, const TileBlock& block);
/// The same for a tile's work space.
void gather_samples(const Lattice& lattice, const BrickLookup& bricks, double fill, Index reach,
                    TileState& tile);

}  // namespace isobrick
