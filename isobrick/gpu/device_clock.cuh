#pragma once

#include <cstdint>

namespace isobrick::gpu {

/// The device's clock, the same for all of its multiprocessors.
__device__ inline std::uint64_t global_nanoseconds() {
  std::uint64_t now;
  asm volatile("mov.u64 %0, %%globaltimer;" : "=l"(now));
  return now;
}

}  // namespace isobrick::gpu
