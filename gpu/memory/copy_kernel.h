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

/// What a device reports of copies, in pinned memory: the host reads it without the
/// driver, which admits one thread at a time.
struct CopyReport {
  unsigned long long completed = 0;  ///< number of the last request that is over
  unsigned long long failed = 0;     ///< what `failed` of launch_report() points to
};

/// Reports, when all before it in the stream is over, that request `number` is. `failed` is read
/// then, if it is not null.
void launch_report(CopyReport* report, unsigned long long number, const unsigned long long* failed,
                   cudaStream_t stream);

}  // namespace isobrick::gpu
