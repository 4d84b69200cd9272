#pragma once

#include <span>
#include <vector>

#include <isobrick/inside.h>
#include <isobrick/range.h>
#include "core/morton.h"
#include "core/tile.h"

namespace isobrick::inline v0 {

/// Appends the tiles with a block of the box `blocks` for which is_active(block) holds, in Morton
/// order. The box's low corner lies on a tile.
template <class IsActive>
void append_tiles_where(Box3 blocks, const IsActive& is_active, std::vector<TileWork>& tiles) {
  constexpr Index edge = kTileEdge / kBlockEdge;
  const Int3 first_tile{blocks.lo.x / edge, blocks.lo.y / edge, blocks.lo.z / edge};
  for_each_morton(ceil_div(blocks.extent(), {edge, edge, edge}), [&](Int3 t) {
    TileWork work{first_tile + t, 0};
    for (int i = 0; i < 8; ++i) {
      const Int3 block = work.tile * edge + Int3{i & 1, i >> 1 & 1, i >> 2};
      if (blocks.contains(block) && is_active(block))
        work.active_blocks |= static_cast<std::uint8_t>(1 << i);
    }
    if (work.active_blocks) tiles.push_back(work);
  });
}

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
