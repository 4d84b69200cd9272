#pragma once

#include "gpu/tile/tile_shared.cuh"

// How warps take what is listed of a tile: 32 things at a time, whose rows 32 threads find by a
// vote over the marks that counting has left (tile_count.cuh).

namespace isobrick::inline v0::gpu {

/// The row of a lane's thing, and its place among the row's.
struct PlaceInRow {
  std::uint32_t row, rank;
};

/// From the marks of 32 things in a row. `lanes` are the own lane and those below.
__device__ inline PlaceInRow place_of_lane(std::uint32_t mark, const FirstOfGroup& group,
                                           std::uint32_t lanes) {
  const unsigned begins = __ballot_sync(kFullMask, mark != 0) & lanes;
  const auto from = static_cast<unsigned>(31 - __clz(static_cast<int>(begins)));
  const std::uint32_t found = __shfl_sync(kFullMask, mark, from);
  if (begins) return {found - 1, lane_id() - from};
  return {group.row, group.before + lane_id()};
}

/// The place of the set bit with `rank` set bits below it.
__device__ inline std::uint32_t nth_bit(std::uint32_t word, std::uint32_t rank) {
  std::uint32_t shift = 32;  // leaves the lowest 32 - shift bits
#pragma unroll
  for (std::uint32_t half = 16; half; half /= 2) {
    const std::uint32_t less = shift - half;
    if (static_cast<std::uint32_t>(__popc(word << less)) <= rank) shift = less;
  }
  return 32 - shift;
}

/// The part of a list that a warp works on: whole groups of 32.
struct WarpPart {
  std::uint32_t begin, end;
};

template <int N>
__device__ inline WarpPart part_of_warp(std::uint32_t listed) {
  const std::uint32_t all = uniform(listed), warp = uniform(warp_id()), groups = (all + 31) / 32;
  const std::uint32_t begin = groups * warp / BlockConfig<N>::kWarps * 32;
  const std::uint32_t end = groups * (warp + 1) / BlockConfig<N>::kWarps * 32;
  return {begin, ::min(end, all)};
}

/// The same where the first warp has something else to do: `First` shares for it when
/// each of the others gets `Others`.
template <int N, int First, int Others>
__device__ inline WarpPart part_beside_first(std::uint32_t listed) {
  if constexpr (BlockConfig<N>::kWarps == 1) {
    return part_of_warp<N>(listed);
  } else {
    constexpr std::uint32_t kParts = Others * (BlockConfig<N>::kWarps - 1) + First;
    const std::uint32_t all = uniform(listed), warp = uniform(warp_id()), groups = (all + 31) / 32;
    const std::uint32_t last = Others * warp + First;
    const std::uint32_t begin = warp == 0 ? 0 : groups * (last - Others) / kParts * 32;
    const std::uint32_t end = groups * last / kParts * 32;
    return {begin, ::min(end, all)};
  }
}

/// Calls f(group) for the groups of 32 out of `listed`, each by the warp that is free first;
/// `next` is 0 before the first.
template <class F>
__device__ inline void for_each_group(std::uint32_t& next, std::uint32_t listed, F&& f) {
  const auto take = [address = static_cast<std::uint32_t>(__cvta_generic_to_shared(&next))] {
    return lane_id() == 0 ? increment_shared(address) : 0;
  };
  const std::uint32_t groups = uniform((listed + 31) / 32);
  std::uint32_t taken = take();
  for (;;) {
    const std::uint32_t group = uniform(taken);
    if (group >= groups) return;
    taken = take();  // on the way while f works
    f(group);
  }
}

/// Finds the marked cells and their cases, and how many triangles each 32 have.
template <int N>
__device__ inline void list_cells(TileShared& s, std::uint32_t listed) {
  auto& lists = lists_of<N>(s);
  const std::uint32_t lanes = kept(lanes_below() << 1 | 1u);
  for_each_group(s.next_cells, listed, [&](std::uint32_t group) {
    const std::uint32_t i = 32 * group + lane_id();
    const PlaceInRow place = place_of_lane(lists.cells[i], lists.cell_groups[group], lanes);
    const std::uint32_t x = nth_bit(s.active_cells[place.row], place.rank);
    const auto pair = [&](int step) {
      const RowBits bits = s.rows[place.row + step];
      return __funnelshift_r(bits.at, bits.last, x) & 3u;
    };
    const std::uint32_t index = pair(0) | pair(1) << 2 | pair(33) << 4 | pair(34) << 6;
    std::uint32_t count = s.cases.triangle_count[index];
    if (i >= listed) count = 0;
    const std::uint32_t sum = warp_inclusive_sum(count);
    if (i < listed) lists.cells[i] = x | place.row << 5 | index << 16 | (sum - count) << 24;
    if (lane_id() == 31) lists.group_triangles[group] = static_cast<std::uint16_t>(sum);
  });
}

/// The triangles of the first `groups` groups of cells. For whole warps.
template <int N>
__device__ inline std::uint32_t triangles_before(TileShared& s, std::uint32_t groups) {
  const auto& lists = lists_of<N>(s);
  std::uint32_t sum = 0;
#pragma unroll 1
  for (std::uint32_t i = lane_id(); i < groups; i += 32) sum += lists.group_triangles[i];
  return warp_sum(sum);
}

}  // namespace isobrick::gpu
