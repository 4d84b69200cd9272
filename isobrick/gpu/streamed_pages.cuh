#pragma once

#include <cstdint>

#include "isobrick/gpu/page_groups.h"

// Where the samples of a streamed tile lie. A tile is read as if 27 pages of 32³
// samples lay around it, but of the 26 that are not its own only the samples within one
// step of its 33³ are ever looked at. Eight tiles share the pages for those: each has
// four columns, rows or planes of them for itself. docs/gpu.md has the picture.

namespace isobrick::gpu {

/// Number of a tile's own page among the 27, x + 3·y + 9·z.
inline constexpr int kOwnPage = 13;

/// Where page `n` of the streamed tile `number` begins, in samples from the first
/// tile's page. It may lie before that: only the places that are looked at do not.
__device__ inline std::int64_t streamed_page(std::uint32_t number, int n) {
  constexpr std::int64_t page = kPageSamples, tiles = kTilesOfPageGroup;
  constexpr std::int64_t of_axis[3] = {tiles * page, (tiles + 1) * page, (tiles + 2) * page};
  constexpr std::int64_t of_edge_xy = (tiles + 3) * page, of_edge_xz = (tiles + 4) * page,
                         of_edge_yz = of_edge_xz + 2048, of_corner = of_edge_yz + 2048;
  static_assert(of_corner + 2048 == kPageGroupSamples);
  const std::int64_t group =
      static_cast<std::int64_t>(number / kTilesOfPageGroup) * kPageGroupSamples;
  const int tile = static_cast<int>(number % kTilesOfPageGroup), place = 4 * tile;
  const int x = n % 3 - 1, y = n / 3 % 3 - 1, z = n / 9 - 1;
  // Towards lower neighbours only the last column is looked at: place 2 of the four.
  const auto along = [&](int direction) { return direction > 0 ? place : place + 2 - 31; };
  // Along an edge between two pages; a and b are steps along its axes.
  const auto between = [&](int da, int a, int db, int b) {
    if (db > 0) return along(da) * a;
    return (place + 3) * a - 31 * b;
  };
  const int negative = (x < 0) + (y < 0) + (z < 0);
  // Of those behind two lower planes nothing is looked at.
  if (negative > 1 || (x == 0 && y == 0 && z == 0)) return group + tile * page;
  if (y == 0 && z == 0) return group + of_axis[0] + along(x);
  if (x == 0 && z == 0) return group + of_axis[1] + along(y) * 32;
  if (x == 0 && y == 0) return group + of_axis[2] + along(z) * 1024;
  if (z == 0) return group + of_edge_xy + between(x, 1, y, 32);
  if (y == 0) return group + of_edge_xz + between(x, 1, z, 1024);
  if (x == 0) return group + of_edge_yz + between(y, 32, z, 1024);
  if (z < 0) return group + of_corner + place + 2 + 32 - 31 * 1024;
  return group + of_corner + between(x, 1, y, 32);
}

}  // namespace isobrick::gpu
