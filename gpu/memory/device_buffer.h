#pragma once

#include <cstddef>
#include <optional>
#include <utility>

#include "gpu/memory/cuda_objects.h"

namespace isobrick::inline v0::gpu {

/// Owns `size` elements of device memory, uninitialised. Throws OutOfDeviceMemory where the device
/// has less.
template <class T>
class DeviceBuffer {
 public:
  DeviceBuffer() = default;
  /// For all streams; freeing it waits for the device.
  explicit DeviceBuffer(std::size_t size) : size_(size) {
    if (size_ > 0) check(cudaMalloc(&data_, size_ * sizeof(T)));
  }
  /// Allocated and freed in the order of a stream.
  DeviceBuffer(std::size_t size, const Stream& stream) : size_(size), stream_(stream) {
    if (size_ > 0) data_ = stream.allocate(size_ * sizeof(T));
  }
  DeviceBuffer(DeviceBuffer&& other) noexcept
      : data_(std::exchange(other.data_, nullptr)),
        size_(std::exchange(other.size_, 0)),
        stream_(std::move(other.stream_)) {}
  DeviceBuffer& operator=(DeviceBuffer&& other) noexcept {
    std::swap(data_, other.data_);
    std::swap(size_, other.size_);
    std::swap(stream_, other.stream_);
    return *this;
  }
  ~DeviceBuffer() {
    if (!data_) return;
    if (stream_)
      stream_->free(data_, bytes());
    else
      (void)cudaFree(data_);
  }

  T* data() const { return static_cast<T*>(data_); }
  std::size_t size() const { return size_; }
  std::size_t bytes() const { return size_ * sizeof(T); }

 private:
  void* data_ = nullptr;
  std::size_t size_ = 0;
  std::optional<Stream> stream_;  ///< nothing: of no stream
};

}  // namespace isobrick::gpu
