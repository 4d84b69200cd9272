#pragma once

#include <algorithm>

#include "gpu/tile/tile_steps.cuh"
#include "gpu/tile/tile_take.cuh"

// The extraction kernel: each thread block makes the meshes of one tile after the other. Its steps
// are those of the CPU (docs/design/surface.md).

namespace isobrick::inline v0::gpu {

template <std::uint32_t Listed, bool Nan = false>
constexpr std::size_t kSharedBytes = sizeof(TileShared) +
                                     (Nan ? std::max(sizeof(Lists<Listed>), sizeof(NanRows))
                                          : sizeof(Lists<Listed>));

static_assert(kSharedBytes<kListedBeforeAmpere, true> <= 64 << 10, "what Turing has");
// What Hopper's multiprocessors have; of each block they take 1 KiB for themselves.
static_assert(3 * (kSharedBytes<BlockConfig<384>::kMaxListed, true> + 1024) <= 228 << 10);
static_assert(2 * (kSharedBytes<BlockConfig<640>::kMaxListed> + 1024) <= 228 << 10);
static_assert(kSharedBytes<BlockConfig<1024>::kMaxListed> <= 99 << 10, "what any later device has");

/// The last block to come here reports to the host and zeroes the counters for the next launch.
/// No fence orders this after the mesh: the host reads the mesh only once the launch is over, and
/// the next launch zeroes the tiles' sums.
template <int N, TileExtra Extra>
__device__ void end_launch(TileShared& s, const TileParams& p) {
  const LaunchEnd& end = p.end;
  if (!end.report) return;
  if (threadIdx.x == 0)
    s.done_before = DeviceFlag(*end.done).fetch_add(1, cuda::memory_order_relaxed);
  __syncthreads();
  if (s.done_before + 1 < gridDim.x) return;
  if (threadIdx.x == 0) {
    report(p, LaunchReport::kActiveTiles, *end.found);
    report(p, LaunchReport::kBlocks, end.blocks ? *end.blocks : 0);
    report(p, LaunchReport::kLeftOut,
           has_samples(Extra) ? DeviceWord(*p.on_samples.left_out).load(cuda::memory_order_relaxed)
                              : 0);
    if (s.items == 0) {
      report(p, LaunchReport::kVertices, 0);
      report(p, LaunchReport::kTriangles, 0);
    }
  }
  if constexpr (has_samples(Extra)) __syncthreads();  // what is zeroed has been read
  for (std::uint32_t i = own_thread(); i < end.zero_words; i += N)
    DeviceFlag(end.zero[i]).store(0, cuda::memory_order_relaxed);  // others have added to them
}

/// Kernels that make vertices on samples treat NaN, too: both need the samples around.
template <int N, class T, bool Normals, bool Nan, TileExtra Extra = TileExtra::none>
__global__ void __launch_bounds__(N, BlockConfig<N>::kBlocks)
    extract_tiles(const __grid_constant__ TileParams p, const T threshold,
                  const CaseTable* __restrict__ cases) {
  static_assert(Nan || !has_samples(Extra));
  extern __shared__ __align__(256) unsigned char shared_bytes[];
  TileShared& s = *reinterpret_cast<TileShared*>(shared_bytes);
  fill_tables<N>(s, cases);
  const Classifier<T> classifier(threshold);
  if (threadIdx.x == 0) {
    s.items = *p.item_count;
    s.all_cells = s.all_vertices = ListsOf<N>::kListed;
    init_barriers<N>(s.barriers);
  }
  __syncwarp();
  take_tile<T>(s, p, next_number(p));
  __syncthreads();
  while (s.item < s.items) {
    classify_tile<N, T, Nan, Extra>(s, p, classifier);
    if constexpr (has_samples(Extra)) find_samples<N>(s, p, threshold);
    if constexpr (is_trilinear(Extra)) find_patched<N, T, Nan, has_samples(Extra)>(s, p);
    if constexpr (has_samples(Extra)) find_on_samples<N, T, is_trilinear(Extra)>(s, p);
    if (count_tile<N, Nan, Extra>(s, p)) {
      place_tile<N, Nan, Extra>(s, p);
      write_tile<N, T, Normals, Nan, Extra>(s, p, threshold);
    }
    if (s.items <= gridDim.x) {  // each block has one at most
      __syncthreads();
      break;
    }
    // No earlier than this: a tile that is taken but not begun holds all later ones up.
    take_tile<T>(s, p, next_number(p));
    __syncthreads();
  }
  end_launch<N, Extra>(s, p);
}

}  // namespace isobrick::gpu
