#pragma once

#include <cstdint>

#include "gpu/stream/stream_layout.h"

// What the host hands to the kernel that unpacks tiles. Plain data, no CUDA header.

namespace isobrick::inline v0::gpu {

/// The tiles of a launch, where their bricks lie, and where the extraction wants the samples.
struct UnpackParams {
  const TileItem* items;
  const TileLinks* links;
  std::uint32_t count;
  const BrickBox* boxes;
  const std::uint64_t* bricks;  ///< `tile_bricks` addresses a tile, on the device or in host memory
  std::uint32_t tile_bricks;
  int reach;               ///< layers of samples around a tile's 33³: 0 or 1
  bool corners;            ///< where those of two axes meet, too
  std::int32_t brick[3];   ///< samples of a brick
  std::int32_t extent[3];  ///< samples of the volume
  double fill_value;       ///< of bricks without an address
  void* tile_blocks;
};

}  // namespace isobrick::gpu
