#pragma once

#include <cuda/atomic>

#include "gpu/tile/tile_shared.cuh"

// Where the tile's vertices and triangles go in the mesh.

namespace isobrick::inline v0::gpu {

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
__device__ inline void report(const TileParams& p, int word, std::uint64_t value) {
  HostWord(p.end.report->words[word])
      .store(LaunchWord::of(value, p.end.launch), cuda::memory_order_relaxed);
}

/// Where the tile's vertices go. One warp.
__device__ inline void place_vertices(TileShared& s, const TileParams& p) {
  const std::uint32_t item = s.item, vertices = s.all_vertices + s.extra_vertices;
  const unsigned long long start = *p.number_start;
  const auto base = sum_before(
      [&](std::uint32_t i) -> unsigned long long& { return p.order[i].vertices; }, item, vertices);
  if (lane_id() != 0) return;
  s.vertex_base = base;
  s.number_base = static_cast<std::uint32_t>(start + base);
  if (item + 1 < s.items) return;
  if (p.end.report)
    report(p, LaunchReport::kVertices, base + vertices);
  else
    p.totals->vertices = base + vertices;
  *p.number_end = start + base + vertices;
}

/// Where the tile's triangles go. One warp.
__device__ inline void place_triangles(TileShared& s, const TileParams& p,
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

}  // namespace isobrick::gpu
