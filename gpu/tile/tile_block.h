#pragma once

#include <cstddef>

#include <isobrick/lattice.h>

namespace isobrick::inline v0::gpu {

/// Samples of a tile as the device keeps them: 32³, C order [z, y, x]. What
/// lies outside of the volume is left as it is. False when all bricks are absent.
bool gather_tile_block(const Lattice& lattice, const BrickLookup& bricks, double fill_value,
                       Int3 tile, std::byte* block);

/// 32³ times the value.
void fill_tile_block(ScalarType type, double value, std::byte* block);

}  // namespace isobrick::gpu
