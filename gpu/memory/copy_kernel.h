#pragma once

#include <cuda_runtime_api.h>

#include <cstddef>
#include <cstdint>

namespace isobrick::inline v0::gpu {

/// Pieces of memory to copy, from where the device can read to where it can write.
struct CopyChunks {
  static constexpr unsigned kMax = 64;
  /// Addresses are multiples of it.
  static constexpr std::size_t kAlign = 16;
  const void* from[kMax];
  void* to[kMax];
  std::uint32_t units[kMax];  ///< of kAlign bytes
  unsigned count = 0;

  /// There is room for one more; `bytes` may be rounded up.
  void add(const void* source, void* target, std::size_t bytes) {
    from[count] = source;
    to[count] = target;
    units[count++] = static_cast<std::uint32_t>((bytes + kAlign - 1) / kAlign);
  }
};

/// Copies them by a kernel, which costs the calling thread less than a request to the copy engine
/// for each.
void launch_copy(const CopyChunks& chunks, cudaStream_t stream);

}  // namespace isobrick::gpu
