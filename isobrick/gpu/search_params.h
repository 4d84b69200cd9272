#pragma once

#include <cstdint>

#include "isobrick/gpu/tile_params.h"

// What the host hands to the search for active tiles. Plain data, no CUDA header.

namespace isobrick::gpu {

/// How a search knows which tiles an isovalue stabs.
enum class TileTest : std::uint8_t {
  ranges,         ///< compares the range of each
  mask_by_order,  ///< bit i of the mask: tile i in Morton order
  mask_by_place,  ///< bit i of the mask: tile i in C order [z, y, x]
  all             ///< takes them all
};

/// All tiles of a volume in Morton order, and what the search for active ones leaves.
struct SearchParams {
  TileTest test;
  bool uncut;  ///< the region of interest is the whole volume
  const std::uint32_t* mask;
  const std::int32_t* tiles;  ///< x, y, z of each
  const void* ranges;         ///< min and max of each, of the sample type
  std::uint32_t count;
  std::int32_t grid[3], roi_lo[3], roi_hi[3];  ///< tiles; samples
  double isovalue;
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
