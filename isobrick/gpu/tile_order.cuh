#pragma once

#include <cuda/atomic>

#include "isobrick/gpu/tile_count.cuh"

// Third step: where the tile's output goes, and the numbers of vertices that
// belong to tiles before it.

namespace isobrick::gpu {

inline constexpr unsigned long long kOwnSum = 1ull << 62, kFullSum = 2ull << 62,
                                    kSumMask = (1ull << 62) - 1;

using DeviceWord = cuda::atomic_ref<unsigned long long, cuda::thread_scope_device>;
using DeviceFlag = cuda::atomic_ref<std::uint32_t, cuda::thread_scope_device>;

__device__ inline unsigned long long warp_sum_64(unsigned long long v) {
#pragma unroll
  for (int d = 16; d; d /= 2) v += __shfl_xor_sync(kAll, v, d);
  return v;
}

/// Publishes an item's own sum: as early as it is known, because all later items
/// wait for it. One thread. `word` is the item's zeroed word.
__device__ inline void publish_sum(unsigned long long& word, std::uint32_t item,
                                   unsigned long long own) {
  DeviceWord(word).store((item == 0 ? kFullSum : kOwnSum) | own, cuda::memory_order_relaxed);
}

/// The sum of all items before one that has published its own; makes the sum
/// with it known to those that follow. One warp. Items are started in order, so
/// everything that is waited for is on its way. `word(i)` is the word of item i.
template <class Word>
__device__ inline unsigned long long sum_before(Word word, std::uint32_t item,
                                                unsigned long long own) {
  // All the tiles that are worked on now may know no more than their own sum, so
  // a warp looks at many of them in the time of one.
  constexpr int kEach = 8;
  if (item == 0) return 0;
  unsigned long long sum = 0;
  bool found = false;
  for (std::int64_t last = static_cast<std::int64_t>(item) - 1; !found; last -= 32 * kEach) {
    unsigned long long seen[kEach];
#pragma unroll
    for (int j = 0; j < kEach; ++j) {
      const std::int64_t i = last - 32 * j - lane_id();
      seen[j] =
          i < 0 ? kFullSum
                : DeviceWord(word(static_cast<std::uint32_t>(i))).load(cuda::memory_order_relaxed);
    }
#pragma unroll
    for (int j = 0; j < kEach; ++j) {
      if (found) break;
      const std::int64_t i = last - 32 * j - lane_id();
      while (seen[j] >> 62 == 0)
        seen[j] = DeviceWord(word(static_cast<std::uint32_t>(i))).load(cuda::memory_order_relaxed);
      // Lanes up to the first that knows everything before it.
      const unsigned full = __ballot_sync(kAll, seen[j] >> 62 == 2);
      const unsigned used = full ? full ^ (full - 1) : kAll;
      sum += used >> lane_id() & 1u ? seen[j] & kSumMask : 0ull;
      found = full != 0;
    }
  }
  sum = warp_sum_64(sum);
  if (lane_id() == 0)
    DeviceWord(word(item)).store(kFullSum | (sum + own), cuda::memory_order_relaxed);
  return sum;
}

/// Where the tile's vertices go; with that its row table is complete. One warp.
__device__ inline void find_vertex_base(TileShared& s, const TileParams& p, std::uint32_t item,
                                        RowTable& table) {
  const auto base =
      sum_before([&](std::uint32_t i) -> unsigned long long& { return p.order[i].vertices; }, item,
                 s.all_vertices);
  if (lane_id() != 0) return;
  s.vertex_base = base;
  table.number_base = static_cast<std::uint32_t>(p.number_base + base);
  DeviceFlag(table.ready).store(p.epoch, cuda::memory_order_release);
  if (item + 1 == *p.item_count) p.totals->vertices = base + s.all_vertices;
}

/// Where the tile's triangles go. One warp.
__device__ inline void find_triangle_base(TileShared& s, const TileParams& p, std::uint32_t item,
                                          std::uint64_t triangles) {
  const auto base =
      sum_before([&](std::uint32_t i) -> unsigned long long& { return p.order[i].triangles; }, item,
                 triangles);
  if (lane_id() != 0) return;
  s.triangle_base = base;
  if (item + 1 == *p.item_count) p.totals->triangles = base + triangles;
}

/// Six threads of a warp, one for each lower neighbour: waits for its numbers.
/// A neighbour that is not active shares no vertex with this tile.
__device__ inline void wait_for_neighbours(TileShared& s, const TileParams& p, const TileItem& item,
                                           const Shape& shape) {
  const unsigned n = lane_id();
  if (n < 1 || n > 6) return;
  const int dx = n & 1, dy = n >> 1 & 1, dz = n >> 2;
  s.neighbour[n] = nullptr;
  s.neighbour_base[n] = 0;
  if ((dx && shape.first[0]) || (dy && shape.first[1]) || (dz && shape.first[2])) return;
  const std::int64_t tile =
      (static_cast<std::int64_t>(item.z - dz) * p.tiles[1] + (item.y - dy)) * p.tiles[0] +
      (item.x - dx);
  const std::uint32_t slot = p.slot_of_tile[tile];
  if (slot == kNone) return;
  RowTable& table = p.row_tables[slot];
  DeviceFlag ready(table.ready);
  while (ready.load(cuda::memory_order_acquire) != p.epoch) __nanosleep(20);
  s.neighbour_base[n] = table.number_base;
  s.neighbour[n] = &table;
}

/// From numbers within the tile to numbers in the mesh (adopt_boundaries of the
/// CPU), but for what borrow_rows takes from others afterwards.
template <int N>
__device__ inline void shift_rows(TileShared& s, const TileParams& p, const Shape& shape) {
  const auto own = static_cast<std::uint32_t>(p.number_base + s.vertex_base);
  const RowTable* before = s.neighbour[1];
  const std::uint32_t base = s.neighbour_base[1];
  const bool first = shape.first[0];
#pragma unroll 2
  for (int row = static_cast<int>(threadIdx.x); row < kRowsOfTile; row += N) {
    const std::uint32_t y = s.y_base[row] + own, z = s.z_base[row] + own;
    s.x_base[row] += own;
    s.y_base[row] = y;
    s.z_base[row] = z;
    // At sample 0 an edge is the one before the row's others, or the last of its
    // kind in the row of the tile before.
    std::uint32_t y_at_0 = y - 1, z_at_0 = z - 1;
    if (!first && before) {
      const std::uint32_t e = before->rows[row];
      y_at_0 = base + (e & 0x1ffffu) + (e >> 23) - 1;
      z_at_0 = base + (before->rows[row + 1] & 0x1ffffu) - 1;
    }
    s.y_at_0[row] = y_at_0;
    s.z_at_0[row] = z_at_0;
  }
}

/// The rows on the lower planes: their vertices belong to tiles before this one.
template <int N>
__device__ inline void borrow_rows(TileShared& s, const Shape& shape) {
  const bool fx = shape.first[0], fy = shape.first[1], fz = shape.first[2];
  const auto entry = [&](int neighbour, int row) {
    const RowTable* table = s.neighbour[neighbour];
    return table ? table->rows[row] : 0u;
  };
  const auto base_of = [&](int neighbour, std::uint32_t e) {
    return s.neighbour_base[neighbour] + (e & 0x1ffffu);
  };
  // Turns 0 … 32: rows (0, z); turns 64 … 96: rows (y, 0).
  for (int t = static_cast<int>(threadIdx.x); t < 97; t += N) {
    if (t < 33 && !fy) {
      const int z = t, row = 33 * z;
      const bool own_z = z > 0 || fz;
      const std::uint32_t e = entry(2, row + 32);
      const int from_x = own_z ? 2 : 6;
      s.x_base[row] = base_of(from_x, own_z ? e : entry(6, kRowsOfTile - 1));
      std::uint32_t at_0 = 0;
      if (z < 32) at_0 = (s.rows[row].at ^ s.rows[row + 33].at) & shape.at_0;
      const std::uint32_t number = base_of(2, e) + (e >> 23) + at_0;
      s.z_base[row] = number;
      s.z_at_0[row] = fx ? number - 1 : base_of(3, entry(3, row + 33)) - 1;
    }
    if (t >= 64 && t < 97 && !fz) {
      const int y = t - 64, row = y;
      const bool own_y = y > 0 || fy;
      const std::uint32_t e = entry(4, 33 * 32 + y);
      if (own_y) s.x_base[row] = base_of(4, e);
      std::uint32_t at_0 = 0;
      if (y < 32) at_0 = (s.rows[row].at ^ s.rows[row + 1].at) & shape.at_0;
      const std::uint32_t number = base_of(4, e) + (e >> 17 & 63u) + at_0;
      s.y_base[row] = number;
      const std::uint32_t corner = entry(5, 33 * 32 + y);
      s.y_at_0[row] = fx ? number - 1 : base_of(5, corner) + (corner >> 23) - 1;
    }
  }
}

/// Bits before the region of interest are counted by ranks but have no vertex.
template <int N>
__device__ inline void clip_rows(TileShared& s, const Shape& shape) {
  const std::uint32_t clipped = (1u << shape.lo[0]) - 1u;
  for (int row = static_cast<int>(threadIdx.x); row < kRowsOfTile; row += N) {
    const RowBits here = s.rows[row];
    const RowBits above = row + 1 < kRowsOfTile ? s.rows[row + 1] : here;
    const RowBits behind = row + 33 < kRowsOfTile ? s.rows[row + 33] : here;
    s.x_base[row] -= __popc((here.at ^ here.next) & clipped);
    s.y_base[row] -= __popc((here.next ^ above.next) & clipped >> 1);
    s.z_base[row] -= __popc((here.next ^ behind.next) & clipped >> 1);
  }
}

}  // namespace isobrick::gpu
