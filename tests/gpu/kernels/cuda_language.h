#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <cstdint>
#include <cstring>
#include <type_traits>

#include "tests/gpu/kernels/shared_bytes.h"
#include "tests/gpu/kernels/thread_block.h"

// Of CUDA C++ what kernels use, as C++ for a CPU.

#define __global__
#define __device__
#define __host__
#define __shared__ thread_local
#define __grid_constant__
#define __launch_bounds__(...)
#define __align__(bytes) __attribute__((aligned(bytes)))

#define threadIdx (isobrick::emulated::thread_place())
#define blockIdx (isobrick::emulated::block_place())
#define gridDim (isobrick::emulated::grid_size())

namespace isobrick::emulated {

using Together = ThreadBlock::Together;

struct Place {
  unsigned x;
};
inline Place thread_place() { return {ThreadBlock::current().thread()}; }
inline Place block_place() { return {ThreadBlock::current().index()}; }
inline Place grid_size() { return {ThreadBlock::current().blocks()}; }

template <class T>
std::array<T, 32> exchange(Together what, T value) {
  return ThreadBlock::current().exchange(what, value);
}

}  // namespace isobrick::emulated

struct alignas(16) uint4 {
  unsigned x, y, z, w;
};

// Threads of a warp do together what they do; none needs a part of them.

inline void __syncthreads() { isobrick::emulated::ThreadBlock::current().wait_for_block(); }
inline void __syncwarp() {
  isobrick::emulated::exchange(isobrick::emulated::Together::warp, std::uint32_t{0});
}
inline void __threadfence() { isobrick::emulated::ThreadBlock::current().fence(); }
inline void __nanosleep(unsigned) { isobrick::emulated::ThreadBlock::current().pause(); }

template <class T>
T __shfl_sync(unsigned, T value, std::uint32_t from) {
  return isobrick::emulated::exchange(isobrick::emulated::Together::shuffle, value)[from % 32];
}
template <class T>
T __shfl_xor_sync(unsigned, T value, int other) {
  const unsigned from = threadIdx.x ^ static_cast<unsigned>(other);
  return isobrick::emulated::exchange(isobrick::emulated::Together::shuffle, value)[from % 32];
}
inline unsigned __ballot_sync(unsigned, bool value) {
  const auto all = isobrick::emulated::exchange(isobrick::emulated::Together::vote, value);
  unsigned bits = 0;
  for (std::size_t i = 0; i < 32; ++i) bits |= (all[i] ? 1u : 0u) << i;
  return bits;
}
inline bool __any_sync(unsigned mask, bool value) { return __ballot_sync(mask, value) != 0; }
inline bool __all_sync(unsigned mask, bool value) { return __ballot_sync(mask, value) == ~0u; }
inline std::uint32_t __reduce_add_sync(unsigned, std::uint32_t value) {
  std::uint32_t sum = 0;
  for (const std::uint32_t v :
       isobrick::emulated::exchange(isobrick::emulated::Together::reduce, value))
    sum += v;
  return sum;
}
inline std::uint32_t __reduce_or_sync(unsigned, std::uint32_t value) {
  std::uint32_t any = 0;
  for (const std::uint32_t v :
       isobrick::emulated::exchange(isobrick::emulated::Together::reduce, value))
    any |= v;
  return any;
}

template <class T>
T atomicAdd(T* to, std::type_identity_t<T> value) {
  return std::atomic_ref(*to).fetch_add(value, std::memory_order_relaxed);
}

template <class T>
T atomicOr(T* to, std::type_identity_t<T> value) {
  return std::atomic_ref(*to).fetch_or(value, std::memory_order_relaxed);
}

template <class T>
T atomicAnd(T* to, std::type_identity_t<T> value) {
  return std::atomic_ref(*to).fetch_and(value, std::memory_order_relaxed);
}

template <class T>
T atomicMin(T* to, std::type_identity_t<T> value) {
  std::atomic_ref word(*to);
  T known = word.load(std::memory_order_relaxed);
  while (value < known && !word.compare_exchange_weak(known, value, std::memory_order_relaxed)) {
  }
  return known;
}

inline std::uint32_t __vimin3_u16x2(std::uint32_t a, std::uint32_t b, std::uint32_t c) {
  const auto least = [&](int shift) {
    return std::min({a >> shift & 0xffffu, b >> shift & 0xffffu, c >> shift & 0xffffu}) << shift;
  };
  return least(0) | least(16);
}
inline std::uint32_t __vimax3_u16x2(std::uint32_t a, std::uint32_t b, std::uint32_t c) {
  const auto most = [&](int shift) {
    return std::max({a >> shift & 0xffffu, b >> shift & 0xffffu, c >> shift & 0xffffu}) << shift;
  };
  return most(0) | most(16);
}

template <class T>
T atomicCAS(T* at, std::type_identity_t<T> expected, std::type_identity_t<T> value) {
  std::atomic_ref(*at).compare_exchange_strong(expected, value, std::memory_order_relaxed);
  return expected;
}

template <class T>
T __ldg(const T* from) {
  return *from;
}
template <class T>
void __stcs(T* to, std::type_identity_t<T> value) {
  *to = value;
}
inline std::size_t __cvta_generic_to_shared(const void* address) {
  return static_cast<std::size_t>(static_cast<const unsigned char*>(address) -
                                  isobrick::gpu::shared_bytes);
}

template <class A, class B>
constexpr std::common_type_t<A, B> min(A a, B b) {
  using T = std::common_type_t<A, B>;
  return static_cast<T>(b) < static_cast<T>(a) ? static_cast<T>(b) : static_cast<T>(a);
}
template <class A, class B>
constexpr std::common_type_t<A, B> max(A a, B b) {
  using T = std::common_type_t<A, B>;
  return static_cast<T>(a) < static_cast<T>(b) ? static_cast<T>(b) : static_cast<T>(a);
}

inline int __popc(std::uint32_t v) { return std::popcount(v); }
inline int __ffs(int v) { return v == 0 ? 0 : std::countr_zero(static_cast<unsigned>(v)) + 1; }
inline int __clz(int v) { return std::countl_zero(static_cast<unsigned>(v)); }
inline std::uint32_t __funnelshift_l(std::uint32_t lo, std::uint32_t hi, std::uint32_t shift) {
  const std::uint64_t both = static_cast<std::uint64_t>(hi) << 32 | lo;
  return static_cast<std::uint32_t>(both << (shift & 31) >> 32);
}
inline std::uint32_t __funnelshift_r(std::uint32_t lo, std::uint32_t hi, std::uint32_t shift) {
  const std::uint64_t both = static_cast<std::uint64_t>(hi) << 32 | lo;
  return static_cast<std::uint32_t>(both >> (shift & 31));
}
/// Four bytes of the eight of `lo` and `hi`, chosen by a digit of `which` each.
inline std::uint32_t __byte_perm(std::uint32_t lo, std::uint32_t hi, std::uint32_t which) {
  const std::uint64_t both = static_cast<std::uint64_t>(hi) << 32 | lo;
  std::uint32_t result = 0;
  for (int i = 0; i < 32; i += 8) {
    const std::uint32_t byte = which >> i / 2 & 7;
    result |= static_cast<std::uint32_t>(both >> 8 * byte & 0xff) << i;
  }
  return result;
}
/// The sum of the products of their four bytes.
inline std::uint32_t __dp4a(std::uint32_t a, std::uint32_t b, std::uint32_t sum) {
  for (int i = 0; i < 32; i += 8) sum += (a >> i & 0xff) * (b >> i & 0xff);
  return sum;
}
inline float __uint_as_float(std::uint32_t bits) { return std::bit_cast<float>(bits); }
