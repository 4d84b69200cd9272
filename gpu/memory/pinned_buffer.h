#pragma once

#include <cstddef>
#include <utility>

#include "gpu/memory/cuda_check.h"
#include "gpu/memory/mapped_pages.h"

namespace isobrick::inline v0::gpu {

/// Owns `size` elements of pinned host memory, zeroed at first: copies from and to it run beside
/// everything else, and kernels read and write it. Its pages are large where possible, which the
/// driver pins three times as fast as those of cudaMallocHost.
template <class T>
class PinnedBuffer {
 public:
  PinnedBuffer() = default;
  /// Throws Error where the host has no room.
  explicit PinnedBuffer(std::size_t size) : PinnedBuffer() {
    if (size == 0) return;
    pages_ = MappedPages(size * sizeof(T));
    size_ = size;
    MappedPages::touch(pages_.data(), pages_.bytes());
    check(cudaHostRegister(pages_.data(), pages_.bytes(), cudaHostRegisterMapped));
    pinned_ = true;
    check(cudaHostGetDevicePointer(&device_, pages_.data(), 0));
  }
  PinnedBuffer(PinnedBuffer&& other) noexcept { *this = std::move(other); }
  PinnedBuffer& operator=(PinnedBuffer&& other) noexcept {
    std::swap(pages_, other.pages_);
    std::swap(size_, other.size_);
    std::swap(pinned_, other.pinned_);
    std::swap(device_, other.device_);
    return *this;
  }
  ~PinnedBuffer() {
    if (pinned_) (void)cudaHostUnregister(pages_.data());
  }

  T* data() const { return reinterpret_cast<T*>(pages_.data()); }
  T& operator[](std::size_t i) const { return data()[i]; }
  std::size_t size() const { return size_; }
  /// The same memory as kernels see it.
  T* on_device() const { return static_cast<T*>(device_); }

 private:
  MappedPages pages_;
  std::size_t size_ = 0;
  bool pinned_ = false;
  void* device_ = nullptr;
};

}  // namespace isobrick::gpu
