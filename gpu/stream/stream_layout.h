#pragma once

#include <cstddef>
#include <cstdint>

#include "gpu/memory/arena.h"
#include "gpu/tile/tile_params.h"

// What the host sends for a launch, in one copy: the header, the items, their links and, where
// a mesh has vertices on samples, neighbours, their zeroed running totals, where the bricks of
// each lie. Bricks that are sent follow.

namespace isobrick::inline v0::gpu {

/// The words of a launch that it counts with.
struct LaunchHeader {
  std::uint32_t item_count, ticket;
  unsigned long long number_start;  ///< for a launch that is made again in parts
  unsigned long long number_end;    ///< likewise
  SurfaceTotals totals;
};

/// The bricks that a tile's samples lie in: the first along each axis, and how many.
struct BrickBox {
  std::int32_t first[3], count[3];
};

/// Where the parts of it begin, in bytes.
struct StagingLayout {
  std::size_t items, links, neighbours, order, boxes, bricks, end;

  /// A tile has at most `tile_bricks` bricks.
  constexpr StagingLayout(std::size_t tiles, std::size_t tile_bricks, bool on_samples)
      : items(Arena::aligned(sizeof(LaunchHeader))),
        links(items + Arena::aligned(tiles * sizeof(TileItem))),
        neighbours(links + Arena::aligned(tiles * sizeof(TileLinks))),
        order(neighbours + Arena::aligned(on_samples ? tiles * sizeof(TileNeighbours) : 0)),
        boxes(order + Arena::aligned(tiles * sizeof(OrderState))),
        bricks(boxes + Arena::aligned(tiles * sizeof(BrickBox))),
        end(bricks + Arena::aligned(tiles * tile_bricks * sizeof(std::uint64_t))) {}
};

}  // namespace isobrick::gpu
