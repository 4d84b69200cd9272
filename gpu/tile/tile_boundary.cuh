#pragma once

#include "gpu/tile/tile_place.cuh"
#include "gpu/tile/tile_row_groups.cuh"

// The numbers of vertices that tiles share: what a tile leaves for later ones, and what it takes of
// those before it.

namespace isobrick::inline v0::gpu {

/// Gives the tile's row table to later tiles, once it is known where its vertices go. One
/// thread.
__device__ inline void publish_boundary(const TileShared& s, const TileParams& p) {
  DeviceWord(p.row_tables[s.tile.slot].base_and_epoch)
      .store(s.number_base | static_cast<unsigned long long>(p.epoch) << 32,
             cuda::memory_order_release);
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
__device__ inline void fetch_boundaries(TileShared& s, const TileParams& p,
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
__device__ inline void adopt_at_0(TileShared& s) {
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
__device__ inline void adopt_rows(TileShared& s) {
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

}  // namespace isobrick::gpu
