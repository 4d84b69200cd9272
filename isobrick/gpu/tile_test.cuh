#pragma once

#include "isobrick/gpu/tile_params.h"

// Which tiles of a resident volume an isovalue stabs.

namespace isobrick::gpu {

/// The page of the tile that lies at `place` in C order [z, y, x] of a resident volume.
__device__ inline std::uint32_t page_of_place(const TileParams& p, std::int64_t place) {
  const std::uint32_t page =
      p.page_of_tile ? p.page_of_tile[place] : static_cast<std::uint32_t>(place + 1);
  return page == kNone ? p.fill_page : page;
}

/// Where tile (t[0], t[1], t[2]) lies in C order [z, y, x].
__device__ inline std::size_t place_of(const std::int32_t* t, const std::int32_t (&grid)[3]) {
  return (static_cast<std::size_t>(t[2]) * grid[1] + t[1]) * grid[0] + t[0];
}

template <class T>
__device__ inline bool is_stabbed(const TileCandidates& c, const std::int32_t (&grid)[3],
                                  double isovalue, std::uint32_t i) {
  if (c.test == TileTest::all) return true;
  if (c.test == TileTest::ranges) {
    const T* range = static_cast<const T*>(c.ranges) + 2 * static_cast<std::size_t>(i);
    return static_cast<double>(range[0]) < isovalue && isovalue <= static_cast<double>(range[1]);
  }
  const std::size_t bit = c.test == TileTest::mask_by_order
                              ? i
                              : place_of(c.tiles + 3 * static_cast<std::size_t>(i), grid);
  return c.mask[bit >> 5] >> (bit & 31) & 1u;
}

/// Whether the isovalue stabs the tile's range and the region of interest leaves it a
/// cell. `p` has candidates, isovalue, roi_lo and roi_hi; `grid` is tiles.
template <class T, class Params>
__device__ inline bool is_active(const Params& p, const std::int32_t (&grid)[3], std::uint32_t i) {
  if (!is_stabbed<T>(p.candidates, grid, p.isovalue, i)) return false;
  if (p.candidates.uncut) return true;
#pragma unroll
  for (int axis = 0; axis < 3; ++axis) {
    const int origin = p.candidates.tiles[3 * static_cast<std::size_t>(i) + axis] * 32;
    if (::min(p.roi_hi[axis] - 1, origin + 32) <= ::max(p.roi_lo[axis], origin)) return false;
  }
  return true;
}

}  // namespace isobrick::gpu
