#pragma once

#include <cstddef>
#include <cstdint>

#include "isobrick/gpu/tile_params.h"

// What the host sends for a launch, in one piece: the header, the items, their links,
// their zeroed running totals, their samples.

namespace isobrick::gpu {

/// The words of a launch that it counts with.
struct LaunchHeader {
  std::uint32_t item_count, ticket;
  unsigned long long number_start;  ///< for a launch that is made again in parts
  unsigned long long number_end;    ///< likewise
  SurfaceTotals totals;
};

/// Where the parts of such a piece begin, in bytes.
struct StagingLayout {
  std::size_t items, links, order, blocks, end;

  constexpr StagingLayout(std::size_t tiles, std::size_t block_bytes)
      : items(aligned(sizeof(LaunchHeader))),
        links(items + aligned(tiles * sizeof(TileItem))),
        order(links + aligned(tiles * sizeof(TileLinks))),
        blocks(order + aligned(tiles * sizeof(OrderState))),
        end(blocks + tiles * block_bytes) {}

  static constexpr std::size_t aligned(std::size_t bytes) {
    return (bytes + 255) & ~std::size_t{255};
  }
};

/// Layers of samples around the 33³ of a tile that are sent along.
constexpr int reach_of(bool normals) { return normals ? 1 : 0; }

/// Bytes from the samples of one tile to those of the next.
constexpr std::size_t block_bytes(bool normals, std::size_t sample_bytes) {
  const auto edge = static_cast<std::size_t>(33 + 2 * reach_of(normals));
  return (edge * edge * edge * sample_bytes + 15) & ~std::size_t{15};
}

}  // namespace isobrick::gpu
