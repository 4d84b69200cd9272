#pragma once

#include "gpu/tile/tile_params.h"

namespace isobrick::inline v0::gpu {

/// The block of the tile that lies at `place` in C order [z, y, x] of a resident volume.
__device__ inline std::uint32_t block_of_place(const TileParams& p, std::int64_t place) {
  const std::uint32_t block =
      p.block_of_tile ? p.block_of_tile[place] : static_cast<std::uint32_t>(place + 1);
  return block == kNone ? p.fill_tile_block : block;
}

}  // namespace isobrick::gpu
