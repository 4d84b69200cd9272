#pragma once

#include "isobrick/gpu/tile_lists.cuh"
#include "isobrick/gpu/tile_page.cuh"

// Small volumes need no launch of their own to find active tiles: the host has found them.

namespace isobrick::gpu {

/// Keeps which candidates are active. The first warp.
__device__ inline void take_found(TileShared& s, const TileParams& p) {
  static_assert(kMostCandidates == 32 * 32);
  if (warp_id() != 0) return;
  // Lanes beyond the candidates ask for no word: each has to be fetched by itself.
  const bool has_word = 32 * lane_id() < p.candidates.count;
  const std::uint32_t word = has_word ? p.found.words[lane_id()] : 0;
  const auto own = static_cast<std::uint32_t>(__popc(word));
  const std::uint32_t sum = warp_inclusive_sum(own);
  s.active[lane_id()] = word;
  s.active_before[lane_id()] = sum - own;
  if (lane_id() == 31) s.items = sum;
  __syncwarp();
}

/// The number of a candidate among the active ones, or kNone.
__device__ inline std::uint32_t number_of_candidate(const TileShared& s, std::uint32_t i) {
  const std::uint32_t word = s.active[i / 32], bit = 1u << (i % 32);
  return word & bit ? s.active_before[i / 32] + __popc(word & (bit - 1)) : kNone;
}

/// The active candidate with that number. One warp.
__device__ inline std::uint32_t candidate_of_number(const TileShared& s, std::uint32_t number) {
  const unsigned begun = __ballot_sync(kAll, s.active_before[lane_id()] <= number);
  const auto word = static_cast<std::uint32_t>(31 - __clz(static_cast<int>(begun)));
  return 32 * word + nth_bit(s.active[word], number - s.active_before[word]);
}

}  // namespace isobrick::gpu
