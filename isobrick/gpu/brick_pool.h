#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>

namespace isobrick::gpu {

class Stream;

/// Memory of the device for bricks, which some threads fill. Each decodes to page-locked
/// buffers of its own, few enough to stay in the caches: one group of bricks is copied while
/// the next one is filled.
class BrickPool {
 public:
  /// Throws Error where the device has no room.
  BrickPool(int device, std::size_t brick_bytes, std::size_t bricks, int threads);
  ~BrickPool();

  /// The next so many bytes, of all its bricks' once. From any thread.
  std::byte* take(std::size_t bytes);

  /// Where `thread` is to put the samples of a brick. Waits until a group has been copied;
  /// makes the thread's buffers at first. Throws Error where the host has no room for them.
  std::byte* begin(int thread);
  /// What begin() was given back for belongs to `place`; at most bricks_of_group() between
  /// two calls of send().
  void end(int thread, std::byte* place);
  /// Sends what `thread` has ended; waits for nothing.
  void send(int thread);
  /// What `stream` does from now on finds all that was sent so far. By one thread at a time.
  void wait_on(const Stream& stream);

  /// Seconds of the copies, from those that were timed, and bytes; when nothing is sent any
  /// more.
  double seconds();
  std::uint64_t bytes() const;

  /// Small copies are slow, on the bus and for the many threads that ask the driver for them;
  /// in large groups threads end at different times.
  static std::size_t bricks_of_group(std::size_t brick_bytes) {
    return std::clamp<std::size_t>((std::size_t{2} << 20) / brick_bytes, 1, 4);
  }
  /// Bricks a thread that should be decoded ahead: bricks that wait take no host memory here.
  static constexpr std::size_t kBricksAhead = 24;
  /// Page-locked host memory that it takes.
  static std::uint64_t pinned_bytes(std::size_t brick_bytes, int threads) {
    return std::uint64_t{2} * static_cast<std::uint64_t>(threads) * bricks_of_group(brick_bytes) *
           brick_bytes;
  }

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace isobrick::gpu
