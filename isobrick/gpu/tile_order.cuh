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

__device__ inline unsigned long long warp_sum(unsigned long long v) {
#pragma unroll
  for (int d = 16; d; d /= 2) v += __shfl_xor_sync(kAll, v, d);
  return v;
}

/// Publishes an item's own sum and returns the sum of all items before it, after
/// making the sum with it known to those that follow. One warp. Items are started
/// in order, so everything that is waited for is on its way. `word(i)` is the
/// zeroed word of item i.
template <class Word>
__device__ inline unsigned long long sum_before(Word word, std::uint32_t item,
                                                unsigned long long own) {
  if (item == 0) {
    if (lane_id() == 0) DeviceWord(word(0)).store(kFullSum | own, cuda::memory_order_relaxed);
    return 0;
  }
  if (lane_id() == 0) DeviceWord(word(item)).store(kOwnSum | own, cuda::memory_order_relaxed);
  unsigned long long sum = 0;
  for (std::int64_t last = static_cast<std::int64_t>(item) - 1;; last -= 32) {
    const std::int64_t i = last - lane_id();
    unsigned long long seen = kFullSum;
    if (i >= 0) {
      DeviceWord ref(word(static_cast<std::uint32_t>(i)));
      while ((seen = ref.load(cuda::memory_order_relaxed)) >> 62 == 0) __nanosleep(20);
    }
    // Lanes up to the first that knows everything before it.
    const unsigned full = __ballot_sync(kAll, seen >> 62 == 2);
    const unsigned used = full ? full ^ (full - 1) : kAll;
    sum += warp_sum(used >> lane_id() & 1u ? seen & kSumMask : 0ull);
    if (full) break;
  }
  if (lane_id() == 0)
    DeviceWord(word(item)).store(kFullSum | (sum + own), cuda::memory_order_relaxed);
  return sum;
}

/// Leaves the row table for later tiles, and the numbers within the tile in shared memory.
__device__ inline void publish_rows(TileShared& s, const Shape& shape, const RowPrefix& prefix,
                                    std::uint32_t before_warp, std::uint32_t vertices,
                                    RowTable& table) {
#pragma unroll 1
  for (int step = 0; step < kRowSteps; ++step) {
    const RowStep r = row_step(step);
    if (!r.valid) continue;
    const RowEdges e = edges_of_row(s, shape, r.row, r.y, r.z);
    const std::uint32_t base = before_warp + prefix.vertices(step);
    const std::uint32_t y = e.y_start(), z = e.z_start();
    table.rows[r.row] = base | y << 17 | z << 23;
    s.x_base[r.row] = base;
    s.y_base[r.row] = base + y + e.y_at_0;
    s.z_base[r.row] = base + z + e.z_at_0;
  }
  if (threadIdx.x == 0) table.rows[kRowsOfTile] = vertices;
}

/// The whole of warp 0: this tile's place, made known to those that follow.
__device__ inline void find_place(TileShared& s, const TileParams& p, std::uint64_t vertices,
                                  std::uint64_t triangles, RowTable& table) {
  const auto v = sum_before(
      [&](std::uint32_t i) -> unsigned long long& { return p.order[i].vertices; }, s.item,
      vertices);
  const auto t = sum_before(
      [&](std::uint32_t i) -> unsigned long long& { return p.order[i].triangles; }, s.item,
      triangles);
  if (lane_id() != 0) return;
  s.vertex_base = v;
  s.triangle_base = t;
  table.number_base = static_cast<std::uint32_t>(p.number_base + v);
  DeviceFlag(table.ready).store(p.epoch, cuda::memory_order_release);
  if (s.item + 1 == *p.item_count) *p.totals = {v + vertices, t + triangles};
}

/// Six threads of warp 0, one for each lower neighbour: waits for its numbers.
/// A neighbour that is not active shares no vertex with this tile.
__device__ inline void wait_for_neighbours(TileShared& s, const TileParams& p,
                                           const TileItem& item, const Shape& shape) {
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

/// From numbers within the tile to numbers in the mesh, with those of edges on
/// the lower planes taken from the tiles that own them (adopt_boundaries of the CPU).
__device__ inline void adopt_numbers(TileShared& s, const TileParams& p, const Shape& shape) {
  const auto own = static_cast<std::uint32_t>(p.number_base + s.vertex_base);
  const bool fx = shape.first[0], fy = shape.first[1], fz = shape.first[2];
  // Bits before the region of interest are counted by ranks but have no vertex.
  const std::uint32_t clipped = (1u << shape.lo[0]) - 1u;
  const auto entry = [&](int neighbour, int y, int z) {
    const RowTable* table = s.neighbour[neighbour];
    return table ? table->rows[z * 33 + y] : 0u;
  };
  for (int row = static_cast<int>(threadIdx.x); row < kRowsOfTile; row += kThreads) {
    const int z = static_cast<int>(z_of_row(row)), y = row - 33 * z;
    const bool own_y = y > 0 || fy, own_z = z > 0 || fz;
    std::uint32_t x_number = s.x_base[row] + own, y_number = s.y_base[row] + own,
                  z_number = s.z_base[row] + own;
    if (!own_y || !own_z) {
      const RowBits here = s.rows[row];
      if (!own_y) {
        const int from_z = own_z ? z : 32;
        const std::uint32_t e = entry(own_z ? 2 : 6, 32, from_z);
        x_number = (e & 0x1ffffu) + s.neighbour_base[own_z ? 2 : 6];
        // Along z the tile below along y owns the row also where z is 0.
        const std::uint32_t ez = entry(2, 32, z);
        const std::uint32_t at_0 =
            fx && shape.lo[0] == 0 && z < 32 ? (here.at ^ s.rows[row + 33].at) & 1u : 0u;
        z_number = (ez & 0x1ffffu) + (ez >> 23) + at_0 + s.neighbour_base[2];
      }
      if (!own_z) {
        const std::uint32_t e = entry(4, y, 32);
        if (own_y) x_number = (e & 0x1ffffu) + s.neighbour_base[4];
        const std::uint32_t at_0 =
            fx && shape.lo[0] == 0 && y < 32 ? (here.at ^ s.rows[row + 1].at) & 1u : 0u;
        y_number = (e & 0x1ffffu) + (e >> 17 & 63u) + at_0 + s.neighbour_base[4];
      }
    }
    std::uint32_t y_at_0 = y_number - 1, z_at_0 = z_number - 1;
    if (!fx) {
      const int ny = own_z ? 1 : 5, nz = own_y ? 1 : 3;
      const std::uint32_t e = entry(ny, y, own_z ? z : 32);
      y_at_0 = (e & 0x1ffffu) + (e >> 23) - 1 + s.neighbour_base[ny];
      const int from = z * 33 + (own_y ? y : 32) + 1;
      const RowTable* table = s.neighbour[nz];
      z_at_0 = (table ? table->rows[from] & 0x1ffffu : 0u) - 1 + s.neighbour_base[nz];
    }
    if (clipped) {
      const RowBits here = s.rows[row];
      const RowBits above = y < 32 ? s.rows[row + 1] : here;
      const RowBits behind = z < 32 ? s.rows[row + 33] : here;
      x_number -= __popc((here.at ^ here.next) & clipped);
      y_number -= __popc((here.next ^ above.next) & clipped >> 1);
      z_number -= __popc((here.next ^ behind.next) & clipped >> 1);
    }
    s.x_base[row] = x_number;
    s.y_base[row] = y_number;
    s.z_base[row] = z_number;
    s.y_at_0[row] = y_at_0;
    s.z_at_0[row] = z_at_0;
  }
}

}  // namespace isobrick::gpu
