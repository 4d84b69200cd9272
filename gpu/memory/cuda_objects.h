#pragma once

#include <cuda_runtime_api.h>

#include <memory>
#include <utility>

#include <isobrick/device_array.h>
#include "gpu/memory/cuda_check.h"

// Owners of streams and events. Destructors wait for nothing and never throw, also
// when the driver has already been shut down at exit.

namespace isobrick::inline v0::gpu {

/// A stream, and where memory that is allocated in its order comes from. Copies are of the same
/// stream, which goes with the last of them.
class Stream {
 public:
  /// One that does not synchronise with the default one.
  Stream() {
    cudaStream_t stream = nullptr;
    check(cudaStreamCreateWithFlags(&stream, cudaStreamNonBlocking));
    state_ = std::make_shared<State>(stream, true, nullptr);
  }
  /// One of others. Memory of the device's own pool where `memory` is null.
  Stream(cudaStream_t stream, std::shared_ptr<DeviceMemory> memory)
      : state_(std::make_shared<State>(stream, false, std::move(memory))) {}

  cudaStream_t get() const { return state_->stream; }
  /// Blocks until all work of the stream is done; throws what went wrong in it.
  void wait() const { check(cudaStreamSynchronize(get())); }
  /// Whether all work of the stream is done; throws what went wrong in it.
  bool is_over() const {
    const cudaError_t state = cudaStreamQuery(get());
    if (state != cudaErrorNotReady) check(state);
    return state == cudaSuccess;
  }

  void* allocate(std::size_t bytes) const {
    if (state_->memory) return state_->memory->allocate(bytes, get());
    void* memory = nullptr;
    check(cudaMallocAsync(&memory, bytes, get()));
    return memory;
  }
  void free(void* memory, std::size_t bytes) const noexcept {
    if (state_->memory)
      state_->memory->free(memory, bytes, get());
    else
      (void)cudaFreeAsync(memory, get());
  }

 private:
  struct State {
    cudaStream_t stream;
    bool is_owned;
    std::shared_ptr<DeviceMemory> memory;

    State(cudaStream_t s, bool owned, std::shared_ptr<DeviceMemory> m)
        : stream(s), is_owned(owned), memory(std::move(m)) {}
    State(const State&) = delete;
    State& operator=(const State&) = delete;
    ~State() {
      if (is_owned) (void)cudaStreamDestroy(stream);
    }
  };
  std::shared_ptr<const State> state_;
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
