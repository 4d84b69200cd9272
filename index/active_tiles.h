#pragma once

#include <span>
#include <vector>

#include <isobrick/range.h>
#include "core/tile.h"

namespace isobrick::inline v0 {

/// Appends the tiles with an active block, in Morton order, found by a linear
/// scan. `blocks` is a box of 16³ blocks whose low corner lies on a tile;
/// `ranges` are its blocks', C order [z, y, x]. Order across several calls is
/// the caller's: cubes of equal power-of-two size in Morton order give Morton order.
template <class T>
void append_active_tiles(Box3 blocks, std::span<const ValueRange<T>> ranges, double isovalue,
                         std::vector<TileWork>& tiles);

}  // namespace isobrick
