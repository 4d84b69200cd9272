#pragma once

#include <span>
#include <vector>

#include <isobrick/inside.h>
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

/// Which blocks a capped surface needs besides those that the isovalue touches: of those with a
/// sample inside, the ones at the border.
struct CapSearch {
  Inside inside = Inside::above;
  Box3 roi;  ///< samples between which there are cells
  /// Cells may be left out anywhere, because of NaN, so that any block may lie at the border.
  bool everywhere = false;

  bool needs(Box3 cells, ValueRange<double> range, double isovalue) const;
};

/// The same for a capped surface.
template <class T>
void append_capped_tiles(Box3 blocks, std::span<const ValueRange<T>> ranges, double isovalue,
                         const CapSearch& cap, std::vector<TileWork>& tiles);

}  // namespace isobrick
