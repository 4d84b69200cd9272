#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <span>

#include <isobrick/range.h>
#include <isobrick/vec.h>

namespace isobrick::inline v0 {

/// A packed brick in a buffer, whose checksum is right.
struct PackedLoad {
  Int3 brick;
  std::size_t bytes = 0;
  ValueRange<double> range;  ///< that its samples must lie within
};

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
  /// Whether its device decodes packed bricks: these two then stand for begin() and end().
  virtual bool takes_packed() const { return false; }
  virtual std::span<std::byte> begin_packed(int /*thread*/) { return {}; }
  virtual void end_packed(int /*thread*/, std::byte* /*place*/, const PackedLoad& /*brick*/) {}
  /// A brick that the device found damaged, or with samples outside of its range; as far as it has
  /// got, or with `all` of all bricks that were ended.
  virtual std::optional<Int3> find_damaged(bool /*all*/) { return std::nullopt; }
  /// Bricks per thread to decode ahead: enough to keep all threads busy while the consumer of
  /// batches does something else.
  virtual std::size_t bricks_ahead() const { return 12; }
};

/// Memory for bricks that the CPU alone reads, in large pages: the first touch of a small page
/// costs as much as decoding its samples.
std::shared_ptr<std::byte> allocate_bricks(std::size_t bytes);

}  // namespace isobrick
