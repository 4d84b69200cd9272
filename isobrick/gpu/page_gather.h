#pragma once

#include <cstddef>

#include "isobrick/core/lattice.h"

namespace isobrick::gpu {

/// Samples of a tile as the device keeps them: 32³, C order [z, y, x]. What
/// lies outside of the volume is left as it is. False when all bricks are absent.
bool gather_page(const Lattice& lattice, const BrickLookup& bricks, double fill_value, Int3 tile,
                 std::byte* page);

/// 32³ times the value.
void fill_page(ScalarType type, double value, std::byte* page);

}  // namespace isobrick::gpu
