#pragma once

#include <atomic>

#include "tests/gpu/kernels/cuda_language.h"

// What gpu/tile/ptx.cuh has, on a CPU. Shared memory is addressed from its first byte on.

namespace isobrick::inline v0::gpu {

inline unsigned own_thread() { return threadIdx.x; }

inline void add_from_below(std::uint32_t& v, int distance) {
  const auto all = emulated::exchange(emulated::Together::shuffle, v);
  const int lane = static_cast<int>(threadIdx.x % 32);
  if (lane >= distance) v += all[static_cast<std::size_t>(lane - distance)];
}

inline std::uint32_t low_bits(std::uint32_t x) { return x < 32 ? (1u << x) - 1 : ~0u; }
inline std::uint32_t bit_at(std::uint32_t place) { return place < 32 ? 1u << place : 0; }

inline void load_shared(std::uint32_t address, std::uint32_t& first, std::uint32_t& second) {
  const auto* from = reinterpret_cast<const std::uint32_t*>(shared_bytes + address);
  first = from[0];
  second = from[1];
}
inline std::uint32_t increment_shared(std::uint32_t address) {
  return atomicAdd(reinterpret_cast<std::uint32_t*>(shared_bytes + address), 1u);
}

/// As late as may be.
inline void begin_copy(std::uint32_t to, const void* from) {
  emulated::ThreadBlock::current().copies().push_back({shared_bytes + to, from});
}
inline void end_copies() {}
inline void wait_for_copies() {
  for (const auto& [to, from] : emulated::ThreadBlock::current().copies())
    std::memcpy(to, from, 16);
  emulated::ThreadBlock::current().copies().clear();
}

/// Eight bytes of shared memory as a barrier: how many have yet to arrive, of how many, and the
/// parity of the phase that is on.
struct SharedBarrier {
  std::atomic<std::uint16_t> left, count;
  std::atomic<std::uint32_t> parity;

  static SharedBarrier& at(std::uint32_t address) {
    return *reinterpret_cast<SharedBarrier*>(shared_bytes + address);
  }
};

inline void init_barrier_at(std::uint32_t address, int count) {
  SharedBarrier& barrier = SharedBarrier::at(address);
  barrier.left = barrier.count = static_cast<std::uint16_t>(count);
  barrier.parity = 0;
}
inline void arrive_at(std::uint32_t address) {
  SharedBarrier& barrier = SharedBarrier::at(address);
  if (barrier.left.fetch_sub(1, std::memory_order_release) > 1) return;
  barrier.left.load(std::memory_order_acquire);
  barrier.left.store(barrier.count);
  barrier.parity.fetch_xor(1);
}
inline bool is_phase_over(std::uint32_t address, std::uint32_t parity) {
  emulated::ThreadBlock::current().pause();
  return SharedBarrier::at(address).parity.load() != parity;
}

}  // namespace isobrick::gpu
