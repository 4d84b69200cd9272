#pragma once

#include <cuda_runtime_api.h>

#include <cstddef>
#include <cstring>
#include <utility>

#include "gpu/memory/cuda_check.h"
#include "gpu/memory/mapped_pages.h"

// Owners of CUDA objects. Destructors wait for nothing and never throw, also
// when the driver has already been shut down at exit.

namespace isobrick::gpu {

/// Owns a stream that does not synchronise with the default one.
class Stream {
 public:
  Stream() { check(cudaStreamCreateWithFlags(&stream_, cudaStreamNonBlocking)); }
  Stream(Stream&& other) noexcept : stream_(std::exchange(other.stream_, nullptr)) {}
  Stream& operator=(Stream&& other) noexcept {
    std::swap(stream_, other.stream_);
    return *this;
  }
  ~Stream() {
    if (stream_) (void)cudaStreamDestroy(stream_);
  }

  cudaStream_t get() const { return stream_; }
  /// Blocks until all work of the stream is done; throws what went wrong in it.
  void wait() const { check(cudaStreamSynchronize(stream_)); }
  /// Whether all work of the stream is done; throws what went wrong in it.
  bool is_over() const {
    const cudaError_t state = cudaStreamQuery(stream_);
    if (state != cudaErrorNotReady) check(state);
    return state == cudaSuccess;
  }

 private:
  cudaStream_t stream_ = nullptr;
};

/// Owns an event that can measure time. With cudaEventBlockingSync a waiting thread
/// sleeps instead of keeping a core busy.
class Event {
 public:
  explicit Event(unsigned flags = cudaEventDefault) {
    check(cudaEventCreateWithFlags(&event_, flags));
  }
  Event(const Event&) = delete;
  Event& operator=(const Event&) = delete;
  ~Event() { (void)cudaEventDestroy(event_); }

  cudaEvent_t get() const { return event_; }
  void record(const Stream& stream) { check(cudaEventRecord(event_, stream.get())); }
  void wait() const { check(cudaEventSynchronize(event_)); }
  /// Milliseconds from `start` to this event; both are over.
  float since(const Event& start) const {
    float ms = 0;
    check(cudaEventElapsedTime(&ms, start.event_, event_));
    return ms;
  }

 private:
  cudaEvent_t event_ = nullptr;
};

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
  /// Allocated and freed in the order of a stream, which must outlive it.
  DeviceBuffer(std::size_t size, const Stream& stream) : size_(size), stream_(stream.get()) {
    if (size_ > 0) check(cudaMallocAsync(&data_, size_ * sizeof(T), stream_));
  }
  DeviceBuffer(DeviceBuffer&& other) noexcept
      : data_(std::exchange(other.data_, nullptr)),
        size_(std::exchange(other.size_, 0)),
        stream_(other.stream_) {}
  DeviceBuffer& operator=(DeviceBuffer&& other) noexcept {
    std::swap(data_, other.data_);
    std::swap(size_, other.size_);
    std::swap(stream_, other.stream_);
    return *this;
  }
  ~DeviceBuffer() {
    if (data_) (void)(stream_ ? cudaFreeAsync(data_, stream_) : cudaFree(data_));
  }

  T* data() const { return static_cast<T*>(data_); }
  std::size_t size() const { return size_; }
  std::size_t bytes() const { return size_ * sizeof(T); }

 private:
  void* data_ = nullptr;
  std::size_t size_ = 0;
  cudaStream_t stream_ = nullptr;  ///< null: of no stream
};

/// Owns one T of pinned host memory that kernels write to; zeroed at first.
template <class T>
class MappedHost {
 public:
  MappedHost() {
    check(cudaHostAlloc(&host_, sizeof(T), cudaHostAllocMapped));
    std::memset(host_, 0, sizeof(T));
    check(cudaHostGetDevicePointer(&device_, host_, 0));
  }
  MappedHost(const MappedHost&) = delete;
  MappedHost& operator=(const MappedHost&) = delete;
  ~MappedHost() { (void)cudaFreeHost(host_); }

  T& operator*() const { return *static_cast<T*>(host_); }
  T* on_device() const { return static_cast<T*>(device_); }

 private:
  void* host_ = nullptr;
  void* device_ = nullptr;
};

/// Owns pinned host memory, for copies that run beside everything else. Mapped in
/// large pages, which are locked three times as fast as those of cudaMallocHost. Kernels may
/// read it under the same address.
class PinnedMemory {
 public:
  PinnedMemory() = default;
  explicit PinnedMemory(std::size_t bytes);
  PinnedMemory(PinnedMemory&& other) noexcept { *this = std::move(other); }
  PinnedMemory& operator=(PinnedMemory&& other) noexcept {
    std::swap(pages_, other.pages_);
    std::swap(locked_, other.locked_);
    return *this;
  }
  ~PinnedMemory();

  void* data() const { return pages_.data(); }

 private:
  MappedPages pages_;
  bool locked_ = false;
};

/// The same for `size` elements.
template <class T>
class PinnedBuffer {
 public:
  PinnedBuffer() = default;
  explicit PinnedBuffer(std::size_t size) : memory_(size * sizeof(T)), size_(size) {}

  T* data() const { return static_cast<T*>(memory_.data()); }
  T& operator[](std::size_t i) const { return data()[i]; }
  std::size_t size() const { return size_; }

 private:
  PinnedMemory memory_;
  std::size_t size_ = 0;
};

}  // namespace isobrick::gpu
