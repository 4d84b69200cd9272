#pragma once

#include "isobrick/gpu/tile_params.h"

namespace isobrick::gpu {

/// The page of the tile that lies at `place` in C order [z, y, x] of a resident volume.
__device__ inline std::uint32_t page_of_place(const TileParams& p, std::int64_t place) {
  const std::uint32_t page =
      p.page_of_tile ? p.page_of_tile[place] : static_cast<std::uint32_t>(place + 1);
  return page == kNone ? p.fill_page : page;
}

}  // namespace isobrick::gpu
