#pragma once

#include "isobrick/gpu/streamed_pages.cuh"
#include "isobrick/gpu/tile_classify.cuh"
#include "isobrick/gpu/tile_find.cuh"
#include "isobrick/gpu/tile_order.cuh"
#include "isobrick/gpu/tile_page.cuh"

// Before the first step: which tile is the next, and where its samples lie.

namespace isobrick::gpu {

/// Pages of the tiles around one, and the first columns of those one higher along x; where
/// there is none, any that is. The first warp.
template <class T>
__device__ inline void find_pages(TileShared& s, const TileParams& p, const TileItem& item,
                                  std::uint32_t number) {
  if (threadIdx.x >= 31) return;
  const int column = static_cast<int>(threadIdx.x) - 27;
  const int n = column < 0 ? static_cast<int>(threadIdx.x)
                           : page_of(32, 32 * (column & 1), 32 * (column >> 1));
  const int dx = n % 3 - 1, dy = n / 3 % 3 - 1, dz = n / 9 - 1;
  std::int64_t start = 0;
  std::uint32_t page = 0;
  if (p.links) {
    start = streamed_page(number, n);
  } else {
    const int x = item.x + dx, y = item.y + dy, z = item.z + dz;
    const bool exists =
        x >= 0 && y >= 0 && z >= 0 && x < p.tiles[0] && y < p.tiles[1] && z < p.tiles[2];
    page = exists
               ? page_of_place(p, (static_cast<std::int64_t>(z) * p.tiles[1] + y) * p.tiles[0] + x)
               : p.fill_page;
    start = static_cast<std::int64_t>(page) * kPageSamples;
  }
  const auto address = [](const void* from, std::int64_t samples) {
    return reinterpret_cast<std::uintptr_t>(from) + samples * static_cast<std::int64_t>(sizeof(T));
  };
  // Samples of the pages, or columns, between.
  const int before = dx * 32 + dy * 1024 + dz * 32768, columns_before = dy * 32 + dz * 1024;
  if (column < 0)
    s.pages[n] = address(p.pages, start - before);
  else if (p.columns)
    s.columns[column] =
        address(p.columns, static_cast<std::int64_t>(page) * kColumnSamples - columns_before);
  else
    s.columns[column] = address(p.pages, start - before + 32);
}

template <int N>
__device__ inline TileItem item_of(TileShared& s, const TileParams& p, std::uint32_t number) {
  if constexpr (Team<N>::kSlabs > 1) {
    const std::uint32_t tile = found_tile<N>(s, p, number / Team<N>::kSlabs);
    return {static_cast<std::int32_t>(tile & 1023u), static_cast<std::int32_t>(tile >> 10 & 1023u),
            static_cast<std::int32_t>(tile >> 20), number};
  }
  if (p.candidates.count == 0) return p.items[number];
  const std::int32_t* tile = p.candidates.tiles + 3 * candidate_of_number(s, number);
  return {tile[0], tile[1], tile[2], number};
}

/// Waits for as long as this block is to begin after the first ones. Where a launch fills the
/// device, the blocks of a multiprocessor would all be in the same step for several tiles, wait
/// for memory and then for instructions. Before a block takes a tile, so that nobody waits for it.
__device__ inline void begin_in_turns(const TileParams& p) {
  if (p.begin_at_once == 0) return;
  constexpr std::uint64_t kNanosecondsApart = 2500;  // of some 17,000 that a tile takes
  const std::uint64_t later = kNanosecondsApart * (blockIdx.x / p.begin_at_once);
  const std::uint64_t start = global_nanoseconds();
  while (global_nanoseconds() - start < later) __nanosleep(200);
}

/// Which tile is the next. The first thread; others get anything.
__device__ inline std::uint32_t next_number(const TileParams& p) {
  return threadIdx.x == 0 ? atomicAdd(p.ticket, 1u) : 0;
}
/// Which is a block's first.
__device__ inline std::uint32_t first_number(const TileParams& p) {
  return p.ticket ? next_number(p) : blockIdx.x;
}

/// The first warp takes the tile, or slab, with that number.
template <int N, class T>
__device__ inline void take_tile(TileShared& s, const TileParams& p, std::uint32_t number) {
  if (warp_id() != 0) return;
  number = __shfl_sync(kAll, number, 0);
  if (lane_id() == 0) s.item = number;
  if (number >= s.items) return;
  const TileItem tile = item_of<N>(s, p, number);
  find_pages<T>(s, p, tile, number);
  if (lane_id() == 0) {
    s.tile = tile;
    s.shape = shape_of(p, tile);
  }
}

/// Brings the samples of a tile that is about to be taken into the L2 cache. One warp.
template <int N, class T>
__device__ inline void prefetch_tile(TileShared& s, const TileParams& p, std::uint32_t number) {
  if (number >= s.items) return;
  constexpr std::uint32_t kLine = 128, kBytes = kPageSamples * sizeof(T);
  const char* from = static_cast<const char*>(p.pages);
  if (p.links) {
    from += streamed_page(number, kOwnPage) * static_cast<std::int64_t>(sizeof(T));
  } else {
    const TileItem item = item_of<N>(s, p, number);
    const std::int64_t place =
        (static_cast<std::int64_t>(item.z) * p.tiles[1] + item.y) * p.tiles[0] + item.x;
    const std::uint32_t page = page_of_place(p, place);
    if (page == p.fill_page) return;
    from += static_cast<std::size_t>(page) * kBytes;
  }
  from += kLine * lane_id();
#pragma unroll
  for (std::uint32_t at = 0; at < kBytes; at += 32 * kLine) prefetch_l2(from + at);
}

}  // namespace isobrick::gpu
