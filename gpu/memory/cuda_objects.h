#pragma once

#include <cuda_runtime_api.h>

#include <utility>

#include "gpu/memory/cuda_check.h"

// Owners of streams and events. Destructors wait for nothing and never throw, also
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

}  // namespace isobrick::gpu
