#pragma once

#include "isobrick/gpu/tile_shared.cuh"

// Where warps of a tile wait for some of the others, not for all as at __syncthreads: barriers in
// shared memory (PTX ISA, mbarrier), at which who arrives goes on at once and who waits need not
// arrive.

namespace isobrick::gpu {

#if __CUDA_ARCH__ >= 800
/// Whether the device has such barriers. Without them tiles take turns, with __syncthreads.
inline constexpr bool kTeamBarriers = true;
#else
inline constexpr bool kTeamBarriers = false;
#endif

__device__ inline std::uint32_t address_of(const unsigned long long& barrier) {
  return static_cast<std::uint32_t>(__cvta_generic_to_shared(&barrier));
}

/// `warps` arrive each time. One thread, once a block.
__device__ inline void init_barrier(unsigned long long& barrier, int warps) {
#if __CUDA_ARCH__ >= 800
  asm volatile("mbarrier.init.shared.b64 [%0], %1;" ::"r"(address_of(barrier)), "r"(32 * warps)
               : "memory");
#endif
}

/// Whole warps: what they have written before is seen by who waits, and by each other. Each thread
/// arrives for itself: of one that arrives for its warp compute-sanitizer's racecheck knows its own
/// writes only.
__device__ inline void arrive(unsigned long long& barrier) {
  __syncwarp();
#if __CUDA_ARCH__ >= 800
  asm volatile(
      "{.reg .b64 state; mbarrier.arrive.shared.b64 state, [%0];}" ::"r"(address_of(barrier))
      : "memory");
#endif
}

/// Whether all have arrived that often: `turn` is 0 for the first time, 1 for the second, 0 again.
/// From Hopper on a thread may sleep for a while before it is told that they have not.
__device__ inline bool have_arrived(const unsigned long long& barrier, std::uint32_t turn) {
  std::uint32_t over = 1;
#if __CUDA_ARCH__ >= 900
#define ISOBRICK_MBARRIER_WAIT "mbarrier.try_wait.parity"
#else
#define ISOBRICK_MBARRIER_WAIT "mbarrier.test_wait.parity"
#endif
#if __CUDA_ARCH__ >= 800
  asm volatile("{.reg .pred over; " ISOBRICK_MBARRIER_WAIT
               ".shared.b64 over, [%1], %2; selp.u32 %0, 1, 0, over;}"
               : "=r"(over)
               : "r"(address_of(barrier)), "r"(turn)
               : "memory");
#endif
#undef ISOBRICK_MBARRIER_WAIT
  return over != 0;
}

__device__ inline void wait(const unsigned long long& barrier, std::uint32_t turn) {
  while (!have_arrived(barrier, turn)) {
#if __CUDA_ARCH__ < 900
    __nanosleep(20);
#endif
  }
}

}  // namespace isobrick::gpu
