#pragma once

#include "gpu/tile/tile_shared.cuh"

// Where warps of a tile wait for some of the others, not for all as at __syncthreads: barriers in
// shared memory (PTX ISA, mbarrier), at which who arrives goes on at once and who waits need not
// arrive.

namespace isobrick::inline v0::gpu {

#if __CUDA_ARCH__ >= 800
/// Whether the device has such barriers. Without them tiles take turns, with __syncthreads.
inline constexpr bool kHasWarpBarriers = true;
#else
inline constexpr bool kHasWarpBarriers = false;
#endif

__device__ inline std::uint32_t address_of(const unsigned long long& barrier) {
  return static_cast<std::uint32_t>(__cvta_generic_to_shared(&barrier));
}

/// `warps` arrive each time. One thread, once a block.
__device__ inline void init_barrier(unsigned long long& barrier, int warps) {
#if __CUDA_ARCH__ >= 800
  init_barrier_at(address_of(barrier), 32 * warps);
#endif
}

/// Whole warps: what they have written before is seen by who waits, and by each other. Each thread
/// arrives for itself: of one that arrives for its warp compute-sanitizer's racecheck knows its own
/// writes only.
__device__ inline void arrive(unsigned long long& barrier) {
  __syncwarp();
#if __CUDA_ARCH__ >= 800
  arrive_at(address_of(barrier));
#endif
}

/// Whether all have arrived that often: `turn` is 0 for the first time, 1 for the second, 0 again.
__device__ inline bool have_arrived(const unsigned long long& barrier, std::uint32_t turn) {
#if __CUDA_ARCH__ >= 800
  return is_phase_over(address_of(barrier), turn);
#else
  return true;
#endif
}

__device__ inline void wait(const unsigned long long& barrier, std::uint32_t turn) {
  while (!have_arrived(barrier, turn)) {
#if __CUDA_ARCH__ < 900
    __nanosleep(20);
#endif
  }
}

}  // namespace isobrick::gpu
