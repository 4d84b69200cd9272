#pragma once

#include <cuda/atomic>

#include "gpu/tile/tile_lists.cuh"
#include "gpu/tile/tile_row_groups.cuh"

// Third step: where the tile's output goes, and the numbers of vertices that
// belong to tiles before it.

namespace isobrick::gpu {

inline constexpr unsigned long long kOwnSum = 1ull << 62, kFullSum = 2ull << 62,
                                    kSumMask = kOrderMask;

using DeviceWord = cuda::atomic_ref<unsigned long long, cuda::thread_scope_device>;
using HostWord = cuda::atomic_ref<std::uint64_t, cuda::thread_scope_system>;
using DeviceFlag = cuda::atomic_ref<std::uint32_t, cuda::thread_scope_device>;
using BlockWord = cuda::atomic_ref<std::uint32_t, cuda::thread_scope_block>;

__device__ inline unsigned long long warp_sum_64(unsigned long long v) {
#pragma unroll
  for (int d = 16; d; d /= 2) v += __shfl_xor_sync(kFullMask, v, d);
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
      const unsigned full = __ballot_sync(kFullMask, seen[j] >> 62 == 2);
      const unsigned used = full ? full ^ (full - 1) : kFullMask;
      sum += used >> lane_id() & 1u ? seen[j] & kSumMask : 0ull;
      found = full != 0;
    }
  }
  sum = warp_sum_64(sum);
  if (lane_id() == 0)
    DeviceWord(word(item)).store(kFullSum | (sum + own), cuda::memory_order_relaxed);
  return sum;
}

/// Writes one word of the launch's report. The words have no order, so none waits for another.
__device__ inline void report(const TileParams& p, LaunchReport::Word word, std::uint64_t value) {
  HostWord(p.end.report->words[word])
      .store(LaunchWord::of(value, p.end.launch), cuda::memory_order_relaxed);
}

/// Where the tile's vertices go. One warp.
__device__ inline void find_vertex_base(TileShared& s, const TileParams& p) {
  const std::uint32_t item = s.item;
  const unsigned long long start = *p.number_start;
  const auto base =
      sum_before([&](std::uint32_t i) -> unsigned long long& { return p.order[i].vertices; }, item,
                 s.all_vertices);
  if (lane_id() != 0) return;
  s.vertex_base = base;
  s.number_base = static_cast<std::uint32_t>(start + base);
  if (item + 1 < s.items) return;
  if (p.end.report)
    report(p, LaunchReport::kVertices, base + s.all_vertices);
  else
    p.totals->vertices = base + s.all_vertices;
  *p.number_end = start + base + s.all_vertices;
}

/// Gives the tile's row table to later tiles, once it is known where its vertices go. One
/// thread.
__device__ inline void release_rows(const TileShared& s, const TileParams& p) {
  DeviceWord(p.row_tables[s.tile.slot].base_and_epoch)
      .store(s.number_base | static_cast<unsigned long long>(p.epoch) << 32,
             cuda::memory_order_release);
}

/// Where the tile's triangles go. One warp.
__device__ inline void find_triangle_base(TileShared& s, const TileParams& p,
                                          std::uint64_t triangles) {
  const std::uint32_t item = s.item;
  const auto base =
      sum_before([&](std::uint32_t i) -> unsigned long long& { return p.order[i].triangles; }, item,
                 triangles);
  if (lane_id() != 0) return;
  s.triangle_base = base;
  if (item + 1 < s.items) return;
  if (p.end.report)
    report(p, LaunchReport::kTriangles, base + triangles);
  else
    p.totals->triangles = base + triangles;
}

/// Where an active tile of a resident volume leaves its row table; kNone for others.
__device__ inline std::uint32_t slot_of(const TileParams& p, int x, int y, int z) {
  const std::int64_t place = (static_cast<std::int64_t>(z) * p.tiles[1] + y) * p.tiles[0] + x;
  return p.slot_of_tile[place];
}

/// Brings the row table of the tile before to shared memory, on the way while this
/// returns. One warp.
__device__ inline void copy_table(RowTable& copy, const RowTable& table) {
#if __CUDA_ARCH__ >= 800
  static_assert(sizeof(RowTable) % 16 == 0);
  const auto to = static_cast<std::uint32_t>(__cvta_generic_to_shared(&copy));
  const char* from = reinterpret_cast<const char*>(&table);
  for (unsigned at = 16 * lane_id(); at < sizeof(RowTable); at += 16 * 32)
    begin_copy(to + at, from + at);
  end_copies();
#else
  for (unsigned i = lane_id(); i <= kRowsOfTile; i += 32) copy.rows[i] = table.rows[i];
#endif
}

/// The row table of a lower neighbour, one for each of lanes 1 … 6: bits 0, 1, 2 of the lane are
/// the axes along which the neighbour is one lower.
struct Neighbour {
  std::uint32_t slot;  ///< or kNone
  bool wait;           ///< the table may not be ready

  __device__ static Neighbour of_lane(const TileShared& s, const TileParams& p) {
    const TileItem& item = s.tile;
    const unsigned n = lane_id();
    if (!has_lower(s, n)) return {kNone, false};
    if (!p.links)
      return {slot_of(p, item.x - static_cast<int>(n & 1), item.y - static_cast<int>(n >> 1 & 1),
                      item.z - static_cast<int>(n >> 2)),
              true};
    const std::uint32_t slot = p.links[s.item].before[n - 1];
    if (slot == kNone) return {kNone, false};
    return {slot & ~TileLinks::kSameLaunch, (slot & TileLinks::kSameLaunch) && !p.tables_known};
  }

 private:
  /// Whether the volume, or the region of interest, has a tile that is one lower like that.
  __device__ static bool has_lower(const TileShared& s, unsigned n) {
    return n >= 1 && n <= 6 && !((n & 1) && s.shape.first[0]) &&
           !((n >> 1 & 1) && s.shape.first[1]) && !((n >> 2) && s.shape.first[2]);
  }
};

/// One warp: waits for the numbers of the lower neighbours, which from now on count
/// from this tile's first vertex, and fetches what this tile needs of their rows.
/// A neighbour that is not active shares no vertex with this tile.
template <int N>
__device__ inline void wait_for_neighbours(TileShared& s, const TileParams& p,
                                           const Neighbour& neighbour) {
  const unsigned n = lane_id();
  const std::uint32_t slot = neighbour.slot;
  if (slot != kNone) {
    DeviceWord word(p.row_tables[slot].base_and_epoch);
    unsigned long long seen = word.load(cuda::memory_order_acquire);
    while (neighbour.wait && seen >> 32 != p.epoch) {
      __nanosleep(20);
      seen = word.load(cuda::memory_order_acquire);
    }
    s.neighbour_base[n] = static_cast<std::uint32_t>(seen) - s.number_base;
  } else if (n < 8) {
    s.neighbour_base[n] = 0;
  }
  __syncwarp();
  const auto slot_of_neighbour = [&](int n) { return __shfl_sync(kFullMask, slot, n); };
  const std::uint32_t before = slot_of_neighbour(1);
  // Where the cells' rows are needed again, the table is read where it is.
  const bool copied = before != kNone && s.all_cells <= ListsOf<N>::kListed;
  RowTable& copy = s.before_copy;
  if (copied) copy_table(copy, p.row_tables[before]);
  if (n == 0) s.before = before == kNone ? nullptr : copied ? &copy : &p.row_tables[before];
  // All on their way before the first is waited for.
  const auto fetch = [&](int neighbour, unsigned row) {
    const std::uint32_t from = slot_of_neighbour(neighbour);
    return from == kNone ? 0 : p.row_tables[from].rows[row];
  };
  const std::uint32_t y = fetch(2, 33 * n + 32), xy = fetch(3, 33 * n + 33),
                      z = fetch(4, 33 * 32 + n), xz = fetch(5, 33 * 32 + n);
  // The last of each, and the row that three tiles share.
  const std::uint32_t from = __shfl_sync(kFullMask, slot, ::min(n + 2, 6u));
  const std::uint32_t last_row = n == 1 ? kRowsOfTile : kRowsOfTile - 1;
  const std::uint32_t last = n < 5 && from != kNone ? p.row_tables[from].rows[last_row] : 0;
  s.lower.y[n] = y;
  s.lower.xy[n] = xy;
  s.lower.z[n] = z;
  s.lower.xz[n] = xz;
  if (n < 4) (&s.lower.y[32])[33 * n] = last;
  if (n == 4) s.lower.yz = last;
#if __CUDA_ARCH__ >= 800
  wait_for_copies();
#endif
}

/// The numbers of vertices that cells at x = 0 have at sample 0: an edge there is
/// the one before the row's others, or the last of its kind in the row of the
/// tile before. `BesideFirst` as for row groups.
template <int N, bool BesideFirst = false>
__device__ inline void number_at_0(TileShared& s) {
  const RowTable* before = s.before;
  const std::uint32_t base = s.neighbour_base[1] - 1;
  const bool own_y = s.shape.first[1], own_z = s.shape.first[2];
  for_each_row_group<N, BesideFirst>([&](auto rows) {
    const OwnRow at(rows);
    if (!at.exists()) return;
    const int row = at.row();
    // The rows on the lower planes are borrowed.
    const bool keep_y = own_z || at.z > 0, keep_z = own_y || at.y > 0;
    std::uint32_t y = 0, z = 0;
    if (before) {
      const std::uint32_t e = before->rows[row];
      y = base + (e & 0x1ffffu) + (e >> 23);
      z = base + (before->rows[row + 1] & 0x1ffffu);
    } else {
      if (keep_y) y = s.number[1][row] - 1;
      if (keep_z) z = s.number[2][row] - 1;
    }
    if (keep_y) s.at_0[0][row] = y;
    if (keep_z) s.at_0[1][row] = z;
  });
}

/// The rows on the lower planes: their vertices belong to tiles before this one.
template <int N>
__device__ inline void borrow_rows(TileShared& s) {
  const Shape& shape = s.shape;
  const bool fx = shape.first[0], fy = shape.first[1], fz = shape.first[2];
  const auto base_of = [&](int neighbour, std::uint32_t e) {
    return s.neighbour_base[neighbour] + (e & 0x1ffffu);
  };
  const auto plane_at_0 = [&](int axis, int at) -> std::uint32_t {
    return shape.at_0 ? s.plane_at_0[axis][at] : 0;
  };
  const auto row_0_of = [&](int z) {
    const int row = 33 * z;
    const bool own_z = z > 0 || fz;
    const std::uint32_t e = s.lower.y[z];
    const int from_x = own_z ? 2 : 6;
    s.number[0][row] = base_of(from_x, own_z ? e : s.lower.yz);
    const std::uint32_t number = base_of(2, e) + (e >> 23) + plane_at_0(0, z);
    s.number[2][row] = number;
    s.at_0[1][row] = fx ? number - 1 : base_of(3, s.lower.xy[z]) - 1;
  };
  const auto row_of_plane_0 = [&](int y) {
    const int row = y;
    const bool own_y = y > 0 || fy;
    const std::uint32_t e = s.lower.z[y];
    if (own_y) s.number[0][row] = base_of(4, e);
    const std::uint32_t number = base_of(4, e) + (e >> 17 & 63u) + plane_at_0(1, y);
    s.number[1][row] = number;
    const std::uint32_t corner = s.lower.xz[y];
    s.at_0[0][row] = fx ? number - 1 : base_of(5, corner) + (corner >> 23) - 1;
  };
  for (auto t = static_cast<int>(own_thread()); t < 128; t += N) {
    if (t < 33 && !fy) row_0_of(t);
    if (t >= 64 && t < 97 && !fz) row_of_plane_0(t - 64);
  }
}

/// The numbers in the mesh from those in the tile. The lower of a cell's edges along
/// y and z are counted by the mask of its upper ones, so one too many. The last warp: the first
/// ones have other rows to see to.
template <int N>
__device__ inline void place_numbers(TileShared& s) {
  const unsigned t = own_thread() - (N - 32);
  if (t >= 24) return;
  const unsigned e = t % 12, at_0 = t / 12;
  const bool lower = e >= 4 && (e & 1u) == 0;
  s.places[at_0][e].addend = s.number_base - (lower && !at_0 ? 1u : 0u);
}

}  // namespace isobrick::gpu
