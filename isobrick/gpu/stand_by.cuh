#pragma once

#include "isobrick/gpu/tile_take.cuh"

// A launch of slabs that stays for the next isovalue. It costs a launch and its report 7 µs to
// cross the bus and begin, and what is asked of blocks that are there already 3.6 (H100). The first
// block looks at the host's memory, for all of them at once would keep each other from it, and
// passes on to the others what it sees: a request, or that time is up. So all of them do the same.

namespace isobrick::gpu {

using PassedWord = cuda::atomic_ref<std::uint64_t, cuda::thread_scope_device>;

/// What a launch is first asked for. One thread.
__device__ inline void begin_launch(LaunchNow& now, const TileParams& p) {
  now.order = p.order;
  now.next_order = p.end.next_order;
  now.launch = p.end.launch;
  now.epoch = p.epoch;
  now.began = p.stand_by.request ? global_nanoseconds() : 0;
  now.crossing = p.crossing;
  now.asked = now.leaves = false;
}

/// Keeps all candidates, so that an isovalue's are found without looking far. One warp.
__device__ inline void keep_tiles(SlabTiles& tiles, const TileParams& p) {
  for (std::uint32_t i = lane_id(); i < p.candidates.count; i += 32) {
    const std::int32_t* t = p.candidates.tiles + 3 * i;
    tiles.all[i] =
        FoundTiles::packed(static_cast<std::uint32_t>(t[0]), static_cast<std::uint32_t>(t[1]),
                           static_cast<std::uint32_t>(t[2]));
  }
  __syncwarp();
}

/// Whether the words that the lanes have seen are the request after this launch.
__device__ inline bool is_next(const LaunchNow& now, std::uint64_t word) {
  return __all_sync(
      kAll, lane_id() >= LaunchRequest::kWords || LaunchWord::is_about(word, now.launch + 1));
}

/// How often a block must have ended an isovalue when all have ended this one.
__device__ inline std::uint32_t all_ended(const LaunchNow& now, const TileParams& p) {
  return p.stand_by.ended_before + gridDim.x * (now.launch - p.end.launch + 1);
}

/// The first block's first warp: waits until all blocks have ended and then until the host has
/// asked, but for neither longer than it may: others may wait for what this launch holds of the
/// device, and its own last blocks for others to go. Passes on what it has seen. A word a lane.
template <int N>
__device__ inline std::uint64_t ask_host(TileShared& s, const TileParams& p) {
  const StandBy& by = p.stand_by;
  const bool has_word = lane_id() < LaunchRequest::kWords;
  std::uint64_t start = global_nanoseconds();
  const bool long_enough = __any_sync(kAll, start - s.now.began > by.most_nanoseconds);
  std::uint64_t word = 0;
  bool ended = false, asked = false;
  do {
    if (!ended) {
      const std::uint32_t seen = DeviceFlag(*by.ended).load(cuda::memory_order_relaxed);
      ended = __all_sync(kAll, seen == all_ended(s.now, p));
      if (!ended) continue;
      __threadfence();  // what the blocks have written is passed on as well
      start = global_nanoseconds();
      if (long_enough) break;
      continue;
    }
    if (has_word) word = HostWord(by.request->words[lane_id()]).load(cuda::memory_order_relaxed);
    asked = is_next(s.now, word);
  } while (!asked && !__any_sync(kAll, global_nanoseconds() - start > by.nanoseconds));
  if (!asked) {
    word = LaunchWord::of(lane_id() == LaunchRequest::kLeave ? 1 : 0, s.now.launch + 1);
    if (lane_id() == 0) say<N>(s, p, LaunchReport::kLeft, s.now.launch);
  }
  if (has_word) PassedWord(by.passed_on->words[lane_id()]).store(word, cuda::memory_order_relaxed);
  return word;
}

/// The same for the first warps of other blocks. Each look empties the multiprocessor's first
/// cache, in which another block may have samples; looks that do not, and a fence at the end, take
/// longer.
__device__ inline std::uint64_t ask_first_block(TileShared& s, const TileParams& p) {
  std::uint64_t word = 0;
  do {
    if (lane_id() < LaunchRequest::kWords)
      word = PassedWord(p.stand_by.passed_on->words[lane_id()]).load(cuda::memory_order_acquire);
  } while (!is_next(s.now, word));
  return word;
}

/// From now on it is the launch that was asked for. One warp, a word a lane.
template <int N>
__device__ inline void take_request(TileShared& s, std::uint64_t word) {
  LaunchNow& now = s.now;
  SlabTiles& tiles = slab_tiles_of<N>(s);
  const auto value = static_cast<std::uint32_t>(word);
  const auto word_of = [&](int i) { return __shfl_sync(kAll, value, i); };
  std::uint32_t count = 0;
#pragma unroll
  for (std::uint32_t i = 0; i < kMostInSlabs / 32; ++i) {
    const std::uint32_t bits = word_of(LaunchRequest::kTiles + i);
    const std::uint32_t number = count + __popc(bits & lanes_below());
    if ((bits >> lane_id() & 1u) && number < kMostActiveInSlabs)
      tiles.found[number] = tiles.all[32 * i + lane_id()];
    count += __popc(bits);
  }
  const std::uint32_t threshold = word_of(LaunchRequest::kThreshold),
                      crossing = word_of(LaunchRequest::kCrossing),
                      leave = word_of(LaunchRequest::kLeave);
  __syncwarp();
  if (lane_id() != 0) return;
  now.threshold = threshold;
  now.crossing = __uint_as_float(crossing);
  now.leaves = leave != 0;
  ++now.launch;
  ++now.epoch;
  OrderState* const before = now.order;
  now.order = now.next_order;
  now.next_order = before;
  now.asked = true;
  s.items = count * Team<N>::kSlabs;
}

/// Waits for the next isovalue and takes the block's slab. False where there is none. All threads.
template <int N, class T>
__device__ inline bool stand_by(TileShared& s, const TileParams& p) {
  if (!p.stand_by.request) return false;
  __syncthreads();
  if (warp_id() == 0) {
    if (lane_id() == 0) DeviceFlag(*p.stand_by.ended).fetch_add(1, cuda::memory_order_release);
    if (!s.now.asked) keep_tiles(slab_tiles_of<N>(s), p);
    take_request<N>(s, blockIdx.x == 0 ? ask_host<N>(s, p) : ask_first_block(s, p));
    __syncwarp();
    if (!s.now.leaves) take_tile<N, T>(s, p, blockIdx.x);
  }
  __syncthreads();
  return !s.now.leaves;
}

/// The threshold that it was asked for last.
template <class T>
__device__ inline T threshold_of(const LaunchNow& now) {
  if constexpr (std::is_same_v<T, float>)
    return __uint_as_float(now.threshold);
  else
    return static_cast<T>(now.threshold);
}

}  // namespace isobrick::gpu
