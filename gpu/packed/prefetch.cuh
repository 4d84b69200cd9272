#pragma once

namespace isobrick::inline v0::gpu {

/// Brings the line of an address into the multiprocessor's cache.
__device__ inline void prefetch(const void* address) {
#ifdef __CUDACC__
  asm volatile("prefetch.global.L1 [%0];" ::"l"(address));
#else
  (void)address;
#endif
}

}  // namespace isobrick::gpu
