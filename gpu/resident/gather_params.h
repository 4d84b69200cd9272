#pragma once

#include <cstdint>

#include "gpu/stream/stream_layout.h"

// What the host hands to the kernel that gathers tiles from bricks. Plain data, no CUDA header.

namespace isobrick::inline v0::gpu {

/// Tiles, where their bricks lie on the device, and where their samples go.
struct GatherParams {
  const std::int32_t* tiles;  ///< x, y, z of each
  const BrickBox* boxes;
  const std::uint64_t* bricks;  ///< `tile_bricks` addresses a tile; 0: absent
  std::uint32_t count;
  std::uint32_t tile_bricks;
  std::int32_t brick[3];   ///< samples of a brick
  std::int32_t extent[3];  ///< samples of the volume
  double fill_value;       ///< of bricks without an address
  void* tile_blocks;       ///< that of the first tile; the others follow
};

}  // namespace isobrick::gpu
