#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

namespace isobrick::inline v0::gpu {

class Stream;

/// Device memory for bricks, which several threads fill. Each decodes to pinned buffers of its
/// own, few enough to stay in its cache: one is copied while the next is filled. The thread that
/// completes a request's number of bricks makes the device copy all of them.
class BrickPool {
 public:
  /// Throws OutOfDeviceMemory where the device has no room. The buffers are got meanwhile.
  BrickPool(int device, std::size_t brick_bytes, std::size_t bricks, int threads);
  ~BrickPool();

  /// The next so many bytes, of all its bricks' once. From any thread.
  std::byte* take(std::size_t bytes);

  /// Where `thread` is to put the samples of a brick; waits until a buffer is free. Throws Error
  /// where the host has no room for them.
  std::byte* begin(int thread);
  /// What begin() was given back for last belongs to `place`. It is copied there before long, in
  /// any case before what wait_on() is for. Throws Error where the host's memory cannot be locked.
  void end(int thread, std::byte* place);
  /// What `stream` does from now on finds all bricks that were ended so far. By one thread at a
  /// time.
  void wait_on(const Stream& stream);

  /// Seconds of the copies, from those that were timed, and bytes; when nothing is sent any
  /// more.
  double seconds();
  std::uint64_t bytes() const;

  /// Buffers of a thread: one to fill, one to copy, and as many again for when that takes longer,
  /// as far as they stay in a core's cache.
  static constexpr std::size_t buffers_of_thread(std::size_t brick_bytes) {
    return std::clamp<std::size_t>((std::size_t{2} << 20) / brick_bytes, 2, 8);
  }
  /// Page-locked host memory that it takes.
  static constexpr std::uint64_t pinned_bytes(std::size_t brick_bytes, int threads) {
    return static_cast<std::uint64_t>(threads) * buffers_of_thread(brick_bytes) * brick_bytes;
  }

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace isobrick::gpu
