#pragma once

#include "isobrick/gpu/tile_lists.cuh"

// Small volumes need no launch of their own to find active tiles: the host has found them.

namespace isobrick::gpu {

/// Words of the candidates' bits that belong to a lane.
inline constexpr std::uint32_t kWordsOfLane = kMostCandidates / 32 / 32;

/// Keeps which candidates are active. The first warp.
__device__ inline void take_found(TileShared& s, const TileParams& p) {
  static_assert(kWordsOfLane == 4);
  if (warp_id() != 0) return;
  const std::uint32_t first = kWordsOfLane * lane_id();
  std::uint32_t words[kWordsOfLane], found[kWordsOfLane];
#pragma unroll
  for (std::uint32_t i = 0; i < kWordsOfLane; ++i) {
    // Lanes beyond the candidates ask for no word: each has to be fetched by itself.
    words[i] = 32 * (first + i) < p.candidates.count ? p.found_words[first + i] : 0;
    found[i] = static_cast<std::uint32_t>(__popc(words[i]));
    s.active[first + i] = words[i];
  }
  const std::uint32_t own = found[0] + found[1] + found[2] + found[3];
  const std::uint32_t before = warp_inclusive_sum(own) - own;
  s.active_before[first / 2] = static_cast<std::uint16_t>(before);
  s.active_before[first / 2 + 1] = static_cast<std::uint16_t>(before + found[0] + found[1]);
  if (lane_id() == 0) s.items = p.found;
  __syncwarp();
}

/// The number of a candidate among the active ones, or kNone.
__device__ inline std::uint32_t number_of_candidate(const TileShared& s, std::uint32_t i) {
  const std::uint32_t word = s.active[i / 32], bit = 1u << (i % 32);
  if (!(word & bit)) return kNone;
  const std::uint32_t other = i / 32 & 1u ? __popc(s.active[i / 32 - 1]) : 0;
  return s.active_before[i / 64] + other + __popc(word & (bit - 1));
}

/// The active candidate with that number. One warp.
__device__ inline std::uint32_t candidate_of_number(const TileShared& s, std::uint32_t number) {
  const unsigned begun = __ballot_sync(kAll, s.active_before[2 * lane_id()] <= number);
  auto pair = 2 * static_cast<std::uint32_t>(31 - __clz(static_cast<int>(begun)));
  if (s.active_before[pair + 1] <= number) ++pair;
  std::uint32_t rank = number - s.active_before[pair], word = 2 * pair;
  const auto in_first = static_cast<std::uint32_t>(__popc(s.active[word]));
  if (rank >= in_first) {
    rank -= in_first;
    ++word;
  }
  return 32 * word + nth_bit(s.active[word], rank);
}

}  // namespace isobrick::gpu
