#include <algorithm>
#include <bit>

#include "core/threshold.h"
#include "gpu/memory/cuda_check.h"
#include "gpu/search/span_kernels.h"
#include "gpu/search/span_walk.cuh"

namespace isobrick::inline v0::gpu {
namespace {

constexpr int kWarps = kSearchThreads / 32;

template <class View, class T>
__global__ void __launch_bounds__(kSearchThreads)
    search_index(const __grid_constant__ View view, const T value, const Marker mark) {
  __shared__ WalkShared<View> shared;
  const std::uint32_t thread = blockIdx.x * kSearchThreads + threadIdx.x;
  walk(view, value, mark, {thread / 32, gridDim.x * kWarps, thread % 32}, shared);
}

__global__ void __launch_bounds__(kSearchThreads) mark_runs(const Marker mark) {
  const std::uint32_t count = ::min(*mark.later.count, mark.later.room);
  for (std::uint32_t i = blockIdx.x; i < count; i += gridDim.x) {
    const Run run = mark.later.runs[i];
    for (std::uint32_t j = threadIdx.x; j < run.n; j += kSearchThreads) mark.item(run.ids[j]);
  }
}

template <class View, class T>
__global__ void __launch_bounds__(kSearchThreads)
    search_indices(const std::byte* blocks, const IndexPlace* places, std::uint32_t count,
                   const T value, std::uint32_t* mask) {
  __shared__ WalkShared<View> shared;
  __shared__ alignas(View) unsigned char bytes[sizeof(View)];
  const std::uint32_t warps = blockDim.x / 32;
  const Crew crew{blockIdx.y * warps + threadIdx.x / 32, gridDim.y * warps, threadIdx.x % 32};
  for (std::uint32_t i = blockIdx.x; i < count; i += gridDim.x) {
    const std::byte* block = blocks + places[i].block;
    __syncthreads();
    if (threadIdx.x == 0)
      new (bytes)
          View(index_detail::view_of<View>(*reinterpret_cast<const IndexHeader*>(block), block));
    __syncthreads();
    const View& view = *reinterpret_cast<const View*>(bytes);
    walk(view, value, Marker{mask + places[i].first_word, {nullptr, nullptr, 0}}, crew, shared);
  }
}

/// Of the threads of a block: the sum before this one, and of all. Ends with a barrier.
struct BlockSum {
  std::uint32_t before, all;

  __device__ BlockSum(std::uint32_t own, std::uint32_t (&of_warp)[kWarps]) {
    const std::uint32_t lane = threadIdx.x % 32, warp = threadIdx.x / 32;
    std::uint32_t sum = own;
#pragma unroll
    for (std::uint32_t d = 1; d < 32; d *= 2) {
      const std::uint32_t below = __shfl_up_sync(0xffffffffu, sum, d);
      if (lane >= d) sum += below;
    }
    if (lane == 31) of_warp[warp] = sum;
    __syncthreads();
    before = sum - own;
    all = 0;
#pragma unroll
    for (std::uint32_t w = 0; w < kWarps; ++w) {
      if (w < warp) before += of_warp[w];
      all += of_warp[w];
    }
    __syncthreads();
  }
};

/// The numbers of bits of all ranges to where each one's ids begin, and their sum
/// behind; one block.
__device__ void place_ranges(const std::uint32_t* counts, std::uint32_t count, std::uint32_t* first,
                             std::uint32_t (&of_warp)[kWarps]) {
  constexpr std::uint32_t kEach = 8;
  std::uint32_t base = 0;
  for (std::uint64_t begin = 0; begin < count; begin += kEach * kSearchThreads) {
    std::uint32_t values[kEach], own = 0;
#pragma unroll
    for (std::uint32_t k = 0; k < kEach; ++k) {
      const std::uint64_t i = begin + kEach * threadIdx.x + k;
      values[k] = i < count ? __ldcg(counts + i) : 0;
      own += values[k];
    }
    const BlockSum sum(own, of_warp);
    std::uint32_t place = base + sum.before;
#pragma unroll
    for (std::uint32_t k = 0; k < kEach; ++k) {
      const std::uint64_t i = begin + kEach * threadIdx.x + k;
      if (i < count) first[i] = place;
      place += values[k];
    }
    base += sum.all;
  }
  if (threadIdx.x == 0) first[count] = base;
}

/// The block that is the last to be done places all ranges.
__global__ void __launch_bounds__(kSearchThreads)
    count_bits(const std::uint32_t* mask, const MaskRange* ranges, std::uint32_t count,
               std::uint32_t* counts, std::uint32_t* done, std::uint32_t* first) {
  __shared__ std::uint32_t of_warp[kWarps];
  __shared__ bool last;
  for (std::uint32_t i = blockIdx.x; i < count; i += gridDim.x) {
    const MaskRange range = ranges[i];
    std::uint32_t bits = 0;
    for (std::uint32_t w = threadIdx.x; w < range.words; w += kSearchThreads)
      bits += __popc(mask[range.first_word + w]);
    const BlockSum sum(bits, of_warp);
    if (threadIdx.x == 0) counts[i] = sum.all;
  }
  if (threadIdx.x == 0) {
    __threadfence();
    last = atomicAdd(done, 1u) + 1 == gridDim.x;
    __threadfence();
  }
  __syncthreads();
  if (!last) return;
  place_ranges(counts, count, first, of_warp);
  if (threadIdx.x == 0) *done = 0;
}

__global__ void __launch_bounds__(kSearchThreads)
    list_bits(const std::uint32_t* mask, const MaskRange* ranges, std::uint32_t count,
              const std::uint32_t* first, std::uint32_t* ids, std::uint64_t room) {
  constexpr std::uint32_t kEach = MaskRange::kWords / kSearchThreads;
  __shared__ std::uint32_t of_warp[kWarps];
  for (std::uint32_t i = blockIdx.x; i < count; i += gridDim.x) {
    const MaskRange range = ranges[i];
    std::uint32_t words[kEach], own = 0;
#pragma unroll
    for (std::uint32_t k = 0; k < kEach; ++k) {
      const std::uint32_t w = kEach * threadIdx.x + k;
      words[k] = w < range.words ? mask[range.first_word + w] : 0;
      own += __popc(words[k]);
    }
    std::uint64_t place = std::uint64_t{first[i]} + BlockSum(own, of_warp).before;
#pragma unroll
    for (std::uint32_t k = 0; k < kEach; ++k) {
      const std::uint32_t id = range.first_id + 32 * (kEach * threadIdx.x + k);
      for (std::uint32_t left = words[k]; left; left &= left - 1, ++place)
        if (place < room)
          ids[place] = id + static_cast<std::uint32_t>(__ffs(static_cast<int>(left))) - 1;
    }
  }
}

/// Blocks that fill the device, but no more than there is work for.
unsigned blocks_for(std::uint64_t work) {
  int device = 0, multiprocessors = 0;
  check(cudaGetDevice(&device));
  check(cudaDeviceGetAttribute(&multiprocessors, cudaDevAttrMultiProcessorCount, device));
  return static_cast<unsigned>(
      std::clamp<std::uint64_t>(work, 1, 8 * static_cast<std::uint64_t>(multiprocessors)));
}

template <template <class> class View, class T>
void search_with(const View<T>& view, std::uint32_t items, T value, const Marker& mark,
                 cudaStream_t stream) {
  const unsigned blocks = blocks_for((std::uint64_t{items} + kSearchThreads - 1) / kSearchThreads);
  search_index<View<T>, T><<<blocks, kSearchThreads, 0, stream>>>(view, value, mark);
  check_launch("search_index");
}

}  // namespace

void launch_search_one(const IndexView& index, double isovalue, std::uint32_t* mask,
                       const RunQueue& later, cudaStream_t stream) {
  visit_index(index, [&]<template <class> class View, class T>(const View<T>& view) {
    const Threshold<T> threshold(isovalue);
    if (!threshold.none)
      search_with(view, index.items(), threshold.value, Marker{mask, later}, stream);
  });
  if (index.kind() != IndexKind::quadtree || later.room == 0) return;
  mark_runs<<<blocks_for(later.room), kSearchThreads, 0, stream>>>(Marker{mask, later});
  check_launch("mark_runs");
}

void launch_search_many(const IndexView& like, const std::byte* blocks, const IndexPlace* places,
                        std::uint32_t count, std::uint32_t max_items, double isovalue,
                        std::uint32_t* mask, cudaStream_t stream) {
  visit_index(like, [&]<template <class> class View, class T>(const View<T>&) {
    const Threshold<T> threshold(isovalue);
    if (threshold.none) return;
    // A warp for few items; several blocks where the indices are few and large.
    const unsigned threads =
        std::clamp<unsigned>(std::bit_ceil(max_items / 64 + 1), 32, kSearchThreads);
    const unsigned room = blocks_for(~0ull);
    const unsigned parts = std::clamp(room / count, 1u, max_items / (4 * kSearchThreads) + 1);
    const dim3 grid(std::min(count, room * (kSearchThreads / threads)), parts);
    search_indices<View<T>, T>
        <<<grid, threads, 0, stream>>>(blocks, places, count, threshold.value, mask);
    check_launch("search_indices");
  });
}

void launch_count_bits(const std::uint32_t* mask, const MaskRange* ranges, std::uint32_t count,
                       std::uint32_t* counts, std::uint32_t* first, cudaStream_t stream) {
  count_bits<<<blocks_for(count), kSearchThreads, 0, stream>>>(mask, ranges, count, counts,
                                                               counts + count, first);
  check_launch("count_bits");
}

void launch_list_bits(const std::uint32_t* mask, const MaskRange* ranges, std::uint32_t count,
                      const std::uint32_t* first, std::uint32_t* ids, std::uint64_t room,
                      cudaStream_t stream) {
  list_bits<<<blocks_for(count), kSearchThreads, 0, stream>>>(mask, ranges, count, first, ids,
                                                              room);
  check_launch("list_bits");
}

}  // namespace isobrick::gpu
