#pragma once

#include <cstdint>

#include "gpu/tile/tile_params.h"

// What the host hands to the search for active tiles. Plain data, no CUDA header.

namespace isobrick::inline v0::gpu {

/// All tiles of a volume in Morton order, and what the search for active ones leaves.
struct SearchParams {
  bool all;                   ///< takes all tiles instead of comparing ranges
  bool uncut;                 ///< the region of interest is the whole volume
  const std::int32_t* tiles;  ///< x, y, z of each
  const void* ranges;         ///< min and max of each, of the sample type
  std::uint32_t count;
  std::int32_t grid[3], roi_lo[3], roi_hi[3];  ///< tiles; samples
  double isovalue;
  /// Of a capped surface (CapSearch): which side is its inside, and whether any tile may lie at the
  /// border.
  bool cap, below, everywhere;
  TileItem* items;  ///< room for all
  std::uint32_t* found;
  std::uint32_t* item_count;  ///< the same, but 0 where it is above item_room
  std::uint32_t item_room;
  std::uint32_t* slot_of_tile;
  OrderState* order;         ///< of the extraction: zeroed for each item
  unsigned long long* sums;  ///< one a block of the search, zeroed
  std::uint32_t* ticket;     ///< zeroed
};

/// Tiles that a block of the search takes.
inline constexpr std::uint32_t kTilesOfSearchBlock = 1024;

}  // namespace isobrick::gpu
