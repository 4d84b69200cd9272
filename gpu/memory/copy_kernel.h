#pragma once

#include <cuda_runtime_api.h>

#include <cstddef>

namespace isobrick::inline v0::gpu {

/// Pieces of memory of the same size to copy, from where the device can read to where it can
/// write.
struct CopyChunks {
  static constexpr unsigned kMax = 64;
  /// Sizes and addresses are multiples of it.
  static constexpr std::size_t kAlign = 16;
  const void* from[kMax];
  void* to[kMax];
  unsigned count = 0;
};

/// Copies them by a kernel, which costs the calling thread less than a request to the copy engine
/// for each.
void launch_copy(const CopyChunks& chunks, std::size_t bytes, cudaStream_t stream);

}  // namespace isobrick::gpu
