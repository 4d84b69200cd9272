#pragma once

#include <cstddef>
#include <cstring>

#if defined(ISOBRICK_ASAN)
#include <sanitizer/asan_interface.h>
#endif

namespace isobrick::inline v0::gpu {

/// What kernels declare as `extern __shared__`: of each thread of the CPU, so of each block.
extern thread_local unsigned char shared_bytes[] __attribute__((aligned(256)));

}  // namespace isobrick::gpu

namespace isobrick::emulated {

inline constexpr std::size_t kMaxSharedBytes = std::size_t{227} << 10;  ///< Hopper's

/// So many bytes of it are a block's; they hold anything at first. AddressSanitizer reports where
/// others are touched.
class SharedBytes {
 public:
  explicit SharedBytes(std::size_t count) : count_(count) {
    std::memset(gpu::shared_bytes, 0xa5, count);
#if defined(ISOBRICK_ASAN)
    __asan_poison_memory_region(gpu::shared_bytes + count_, kMaxSharedBytes - count_);
#endif
  }
  ~SharedBytes() {
#if defined(ISOBRICK_ASAN)
    __asan_unpoison_memory_region(gpu::shared_bytes + count_, kMaxSharedBytes - count_);
#endif
  }
  SharedBytes(const SharedBytes&) = delete;
  SharedBytes& operator=(const SharedBytes&) = delete;

 private:
  [[maybe_unused]] std::size_t count_;
};

}  // namespace isobrick::emulated
