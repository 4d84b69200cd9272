#include <algorithm>

#include "isobrick/core/threshold.h"
#include "isobrick/gpu/cuda_check.h"
#include "isobrick/gpu/span_kernels.h"
#include "isobrick/gpu/span_walk.cuh"

namespace isobrick::gpu {
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
  const Crew crew{threadIdx.x / 32, blockDim.x / 32, threadIdx.x % 32};
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

__device__ std::uint32_t sum_of_warp(std::uint32_t v) {
#pragma unroll
  for (int d = 16; d; d /= 2) v += __shfl_xor_sync(0xffffffffu, v, d);
  return v;
}

__global__ void __launch_bounds__(kSearchThreads)
    count_bits(const std::uint32_t* mask, const MaskPiece* pieces, std::uint32_t count,
               std::uint32_t* counts) {
  __shared__ std::uint32_t of_warp[kWarps];
  for (std::uint32_t i = blockIdx.x; i < count; i += gridDim.x) {
    const MaskPiece piece = pieces[i];
    std::uint32_t bits = 0;
    for (std::uint32_t w = threadIdx.x; w < piece.words; w += kSearchThreads)
      bits += __popc(mask[piece.first_word + w]);
    bits = sum_of_warp(bits);
    if (threadIdx.x % 32 == 0) of_warp[threadIdx.x / 32] = bits;
    __syncthreads();
    if (threadIdx.x == 0) {
      for (int w = 1; w < kWarps; ++w) bits += of_warp[w];
      counts[i] = bits;
    }
    __syncthreads();
  }
}

__global__ void __launch_bounds__(kSearchThreads)
    list_bits(const std::uint32_t* mask, const MaskPiece* pieces, std::uint32_t count,
              const std::uint32_t* first, std::uint32_t* ids, std::uint64_t room) {
  constexpr std::uint32_t kEach = MaskPiece::kWords / kSearchThreads;
  __shared__ std::uint32_t of_warp[kWarps];
  const std::uint32_t lane = threadIdx.x % 32, warp = threadIdx.x / 32;
  for (std::uint32_t i = blockIdx.x; i < count; i += gridDim.x) {
    const MaskPiece piece = pieces[i];
    std::uint32_t words[kEach], own = 0;
#pragma unroll
    for (std::uint32_t k = 0; k < kEach; ++k) {
      const std::uint32_t w = kEach * threadIdx.x + k;
      words[k] = w < piece.words ? mask[piece.first_word + w] : 0;
      own += __popc(words[k]);
    }
    std::uint32_t sum = own;
#pragma unroll
    for (std::uint32_t d = 1; d < 32; d *= 2) {
      const std::uint32_t below = __shfl_up_sync(0xffffffffu, sum, d);
      if (lane >= d) sum += below;
    }
    if (lane == 31) of_warp[warp] = sum;
    __syncthreads();
    std::uint64_t place = std::uint64_t{first[i]} + sum - own;
    for (std::uint32_t w = 0; w < warp; ++w) place += of_warp[w];
#pragma unroll
    for (std::uint32_t k = 0; k < kEach; ++k) {
      const std::uint32_t id = piece.first_id + 32 * (kEach * threadIdx.x + k);
      for (std::uint32_t left = words[k]; left; left &= left - 1, ++place)
        if (place < room)
          ids[place] = id + static_cast<std::uint32_t>(__ffs(static_cast<int>(left))) - 1;
    }
    __syncthreads();
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
                        std::uint32_t count, int threads, double isovalue, std::uint32_t* mask,
                        cudaStream_t stream) {
  visit_index(like, [&]<template <class> class View, class T>(const View<T>&) {
    const Threshold<T> threshold(isovalue);
    if (threshold.none) return;
    const unsigned grid =
        std::min(count, blocks_for(~0ull) * (kSearchThreads / static_cast<unsigned>(threads)));
    search_indices<View<T>, T>
        <<<grid, threads, 0, stream>>>(blocks, places, count, threshold.value, mask);
    check_launch("search_indices");
  });
}

void launch_count_bits(const std::uint32_t* mask, const MaskPiece* pieces, std::uint32_t count,
                       std::uint32_t* counts, cudaStream_t stream) {
  count_bits<<<blocks_for(count), kSearchThreads, 0, stream>>>(mask, pieces, count, counts);
  check_launch("count_bits");
}

void launch_list_bits(const std::uint32_t* mask, const MaskPiece* pieces, std::uint32_t count,
                      const std::uint32_t* first, std::uint32_t* ids, std::uint64_t room,
                      cudaStream_t stream) {
  list_bits<<<blocks_for(count), kSearchThreads, 0, stream>>>(mask, pieces, count, first, ids,
                                                              room);
  check_launch("list_bits");
}

}  // namespace isobrick::gpu
