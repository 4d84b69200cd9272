#pragma once

#include <cstddef>
#include <memory>

namespace isobrick::inline v0 {

/// Memory for decoded bricks, and their transfer into it. Thread-safe.
class BrickMemory {
 public:
  virtual ~BrickMemory() = default;

  /// Memory for bricks, one after the other; freed with the last pointer to it.
  virtual std::shared_ptr<std::byte> room(std::size_t bytes) = 0;
  /// The buffer that decoder `thread`, counted from 0, writes a brick to. `place` in that memory
  /// need not be writable by the CPU.
  virtual std::byte* begin(int /*thread*/, std::byte* place) { return place; }
  /// The thread's last buffer is complete and belongs to `place`. Transfers it, so that readers of
  /// that memory find it.
  virtual void end(int /*thread*/, std::byte* /*place*/) {}
  /// Bricks per thread to decode ahead: enough to keep all threads busy while the consumer of
  /// batches does something else.
  virtual std::size_t bricks_ahead() const { return 12; }
};

/// Memory for bricks that the CPU alone reads, in large pages: the first touch of a small page
/// costs as much as decoding its samples.
std::shared_ptr<std::byte> allocate_bricks(std::size_t bytes);

}  // namespace isobrick
