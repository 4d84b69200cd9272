#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include <isobrick/lattice.h>
#include <isobrick/range.h>
#include "gpu/packed/decode_params.h"

namespace isobrick::inline v0::gpu {

class Stream;

/// Device memory for bricks, which several threads fill. Each decodes to pinned buffers of its
/// own, few enough to stay in its cache: one is copied while the next is filled. The thread that
/// completes a request's number of bricks makes the device copy all of them. Packed bricks are read
/// to the buffers, and the device decodes them as well.
class BrickPool {
 public:
  /// Throws OutOfDeviceMemory where the device has no room. The buffers are got meanwhile.
  BrickPool(int device, const Lattice& lattice, std::size_t bricks, int threads,
            bool packed = false);
  ~BrickPool();

  /// The next so many bytes, of all its bricks' once. From any thread.
  std::byte* take(std::size_t bytes);

  /// Where `thread` is to put the samples of a brick; waits until a buffer is free. Throws Error
  /// where the host has no room for them.
  std::byte* begin(int thread);
  /// What begin() was given back for last belongs to `place`. It is copied there before long, in
  /// any case before what wait_on() is for. Throws Error where the host's memory cannot be locked.
  void end(int thread, std::byte* place);
  /// The same of a packed brick, without its checksum: `bytes` from where begin() was.
  void end_packed(int thread, std::byte* place, std::size_t bytes, Int3 brick,
                  ValueRange<double> range);
  /// A packed brick that the device found wrong; with `all` after all that were ended, by one
  /// thread at a time.
  std::optional<Int3> find_damaged(bool all);
  /// What `stream` does from now on finds all bricks that were ended so far. By one thread at a
  /// time.
  void wait_on(const Stream& stream);

  /// Seconds of the copies, from those that were timed, and bytes; when nothing is sent any
  /// more.
  double seconds();
  std::uint64_t bytes() const;

  /// Bytes of a buffer that begin() gives.
  static std::size_t buffer_bytes(const Lattice& lattice, bool packed) {
    return packed ? packed_room(lattice) : lattice.brick_bytes();
  }
  /// Buffers of a thread: one to fill, one to copy, and as many again for when that takes longer,
  /// as far as they stay in a core's cache.
  /// Packed bricks leave most of a buffer untouched, and are on their way for longer.
  static constexpr std::size_t buffers_of_thread(std::size_t buffer_bytes, bool packed = false) {
    const std::size_t few = std::clamp<std::size_t>((std::size_t{2} << 20) / buffer_bytes, 2, 8);
    return packed ? 2 * few : few;
  }
  /// Page-locked host memory that it takes.
  static constexpr std::uint64_t pinned_bytes(std::size_t buffer_bytes, int threads,
                                              bool packed = false) {
    return static_cast<std::uint64_t>(threads) * buffers_of_thread(buffer_bytes, packed) *
           buffer_bytes;
  }

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace isobrick::gpu
