#pragma once

#include <tbb/task_group.h>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include <isobrick/store_reader.h>
#include "stream/batch_bricks.h"
#include "stream/brick_reader.h"
#include "stream/brick_slots.h"

namespace isobrick::inline v0 {

/// The bricks of tiles that are extracted together, which stay in place until this is destroyed,
/// by the cache's thread and before the cache. The caller waits for them in the order in which it
/// began them. After an error or an early destruction the cache cannot be used any more.
class CachedBricks final : public BrickLookup {
 public:
  CachedBricks(BrickSlots& slots, std::span<const Int3> bricks, Int3 last);
  CachedBricks(const CachedBricks&) = delete;
  CachedBricks& operator=(const CachedBricks&) = delete;
  /// Begins no more decoding, and waits for the bricks that are being decoded.
  ~CachedBricks() noexcept override;

  /// Decodes, along with the other threads, until all bricks are resident: find() is valid
  /// afterwards. Called once. Throws the errors of reading and decoding.
  void wait();

  const std::byte* find(Int3 brick) const override { return bricks_.find(brick); }

 private:
  friend class BrickCache;
  struct Load : BrickLoad {
    bool present = false;
  };

  BatchBricks bricks_;
  std::vector<Load> loads_;
  tbb::task_group tasks_;
};

/// Decoded bricks of a level, for batches of tiles in Morton order. The threads of the caller's
/// TBB arena decode them as tasks beside their other work, so the bricks of one batch can be begun
/// while those of another are used. For one thread. (BatchDecoder has threads of its own.)
class BrickCache {
 public:
  /// Holds at most `capacity` bricks at a time, for tiles with `reach` layers of samples around
  /// them. Allocates memory when it is needed.
  BrickCache(const StoreReader& store, int level, Index reach, std::size_t capacity);

  /// Begins to decode those of `bricks` that are not resident. They must fit beside the bricks
  /// that are in use. See BatchBricks.
  std::unique_ptr<CachedBricks> begin(std::span<const Int3> bricks, Int3 last);

  /// Hints to the disk that these bricks follow those that were begun. A task looks up where they
  /// are stored; begun.wait() throws its errors.
  void will_need(CachedBricks& begun, std::vector<Int3> bricks);

  /// Bricks read and decoded so far, and how many different ones.
  std::uint64_t reads() const { return slots_.reads(); }
  std::uint64_t bricks_read() const { return slots_.bricks_read(); }

 private:
  void grow();

  const BrickReader reader_;
  const std::size_t capacity_;
  BrickSlots slots_;
};

}  // namespace isobrick
