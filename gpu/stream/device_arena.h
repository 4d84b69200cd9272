#pragma once

#include <cuda_runtime_api.h>

#include <cstddef>

#include "gpu/memory/cuda_check.h"
#include "gpu/stream/stream_layout.h"

namespace isobrick::gpu {

/// One range of device memory, handed out from the front.
class DeviceArena {
 public:
  /// Empty when the device does not have so much.
  explicit DeviceArena(std::size_t bytes) {
    void* data = nullptr;
    const cudaError_t result = cudaMalloc(&data, bytes);
    if (result == cudaErrorMemoryAllocation) {
      (void)cudaGetLastError();  // or the next launch would report it
      return;
    }
    check(result);
    data_ = static_cast<std::byte*>(data);
  }
  DeviceArena(const DeviceArena&) = delete;
  DeviceArena& operator=(const DeviceArena&) = delete;
  ~DeviceArena() {
    if (data_) (void)cudaFree(data_);
  }

  explicit operator bool() const { return data_ != nullptr; }
  /// The next so many elements, at a multiple of 256 bytes.
  template <class T>
  T* take(std::size_t count) {
    std::byte* at = data_ + used_;
    used_ += StagingLayout::aligned(count * sizeof(T));
    return reinterpret_cast<T*>(at);
  }

 private:
  std::byte* data_ = nullptr;
  std::size_t used_ = 0;
};

}  // namespace isobrick::gpu
