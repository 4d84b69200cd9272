#pragma once

#include <cstdint>

// Instructions that CUDA C++ has no name for, or that its compiler would not choose (PTX ISA), and
// nothing else: tests that run the kernels on a CPU have a header of the same name.

namespace isobrick::inline v0::gpu {

/// The thread's number, read anew at each call, so that values derived from it need no registers
/// throughout a tile.
__device__ inline unsigned own_thread() {
  unsigned thread;
  asm volatile("mov.u32 %0, %%tid.x;" : "=r"(thread));
  return thread;
}

/// Adds what the lane `distance` below has, if there is one; the shuffle reports whether.
__device__ inline void add_from_below(std::uint32_t& v, int distance) {
  asm volatile(
      "{.reg .pred there; .reg .u32 below;\n"
      "shfl.sync.up.b32 below|there, %0, %1, 0, 0xffffffff;\n"
      "@there add.u32 %0, %0, below;}"
      : "+r"(v)
      : "r"(distance));
}

/// The lowest `x` bits.
__device__ inline std::uint32_t low_bits(std::uint32_t x) {
  std::uint32_t mask;
  asm("bmsk.clamp.b32 %0, 0, %1;" : "=r"(mask) : "r"(x));
  return mask;
}

/// 1 at that place; 0 where it is none of 0 … 31.
__device__ inline std::uint32_t bit_at(std::uint32_t place) {
  std::uint32_t bit;
  asm("shl.b32 %0, 1, %1;" : "=r"(bit) : "r"(place));
  return bit;
}

/// The two words at an address in shared memory.
__device__ inline void load_shared(std::uint32_t address, std::uint32_t& first,
                                   std::uint32_t& second) {
  asm("ld.shared.v2.u32 {%0, %1}, [%2];" : "=r"(first), "=r"(second) : "r"(address));
}

/// Adds 1 to the word at an address in shared memory; what it was. As an addition that never comes
/// round: the compiler would add up for any number of threads what one of them adds.
__device__ inline std::uint32_t increment_shared(std::uint32_t address) {
  std::uint32_t before;
  asm volatile("atom.shared.inc.u32 %0, [%1], 0x7fffffff;"
               : "=r"(before)
               : "r"(address)
               : "memory");
  return before;
}

#if __CUDA_ARCH__ >= 800
/// Copies 16 bytes to an address in shared memory, on the way while this returns. With several, a
/// thread signals when it has begun all and waits until its own are there.
__device__ inline void begin_copy(std::uint32_t to, const void* from) {
  asm volatile("cp.async.cg.shared.global [%0], [%1], 16;" ::"r"(to), "l"(from) : "memory");
}
__device__ inline void end_copies() { asm volatile("cp.async.commit_group;" ::: "memory"); }
__device__ inline void wait_for_copies() { asm volatile("cp.async.wait_all;" ::: "memory"); }

/// Barriers in shared memory: `count` threads arrive each time.
__device__ inline void init_barrier_at(std::uint32_t address, int count) {
  asm volatile("mbarrier.init.shared.b64 [%0], %1;" ::"r"(address), "r"(count) : "memory");
}
__device__ inline void arrive_at(std::uint32_t address) {
  asm volatile("{.reg .b64 state; mbarrier.arrive.shared.b64 state, [%0];}" ::"r"(address)
               : "memory");
}
/// Whether the phase with that parity is over. From Hopper on a thread may sleep for a while before
/// it gets the answer no.
__device__ inline bool is_phase_over(std::uint32_t address, std::uint32_t parity) {
  std::uint32_t over;
#if __CUDA_ARCH__ >= 900
#define ISOBRICK_MBARRIER_WAIT "mbarrier.try_wait.parity"
#else
#define ISOBRICK_MBARRIER_WAIT "mbarrier.test_wait.parity"
#endif
  asm volatile("{.reg .pred over; " ISOBRICK_MBARRIER_WAIT
               ".shared.b64 over, [%1], %2; selp.u32 %0, 1, 0, over;}"
               : "=r"(over)
               : "r"(address), "r"(parity)
               : "memory");
#undef ISOBRICK_MBARRIER_WAIT
  return over != 0;
}
#endif

}  // namespace isobrick::gpu
