#pragma once

#include <tbb/task_group.h>

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <span>
#include <unordered_map>
#include <vector>

#include <isobrick/store_reader.h>
#include "core/tile.h"
#include "stream/brick_check.h"
#include "stream/brick_slots.h"

namespace isobrick {

class BrickCache;

/// The bricks of tiles that are worked on together, which stay where they are until this is
/// destroyed (by the cache's thread, and before the cache). They are waited for in the order in
/// which they were begun; once that failed or was given up, the cache is of no use any more.
class CachedBricks final : public BrickLookup {
 public:
  explicit CachedBricks(BrickCache& cache) : cache_(cache) {}
  CachedBricks(const CachedBricks&) = delete;
  CachedBricks& operator=(const CachedBricks&) = delete;
  /// Decodes nothing more, but waits for what is being decoded.
  ~CachedBricks() noexcept override;

  /// Decodes, along with the other threads, until all is there: find() is for afterwards.
  /// Throws what went wrong in reading or decoding.
  void wait();

  const std::byte* find(Int3 brick) const override;

 private:
  friend class BrickCache;
  struct Load {
    Int3 brick;
    std::byte* samples = nullptr;
    bool present = false;
  };

  BrickCache& cache_;
  std::vector<Int3> bricks_;  ///< held
  std::vector<Load> loads_;   ///< what was not there
  std::unordered_map<std::uint64_t, const std::byte*> samples_;
  tbb::task_group tasks_;
};

/// Decoded bricks of a level, for batches of tiles in Morton order. Decoding is done by the
/// threads of the TBB arena that all calls come from, beside whatever else they have to do; so
/// the bricks of one batch may be begun while those of another are used. For one thread.
class BrickCache {
 public:
  /// At most `capacity` bricks are held at a time. They are used by tiles with `reach` layers of
  /// samples around them. Memory is got when it is needed.
  BrickCache(const StoreReader& store, int level, Index reach, std::size_t capacity);

  /// Begins to decode what is missing of `bricks`, which must fit beside those that are in use;
  /// no brick is there twice. `last` is the last of the tiles that they are for: what neither it
  /// nor a later tile needs goes when it is not used any more. Where there is no room, what is
  /// needed last goes first.
  std::unique_ptr<CachedBricks> begin(std::span<const Int3> bricks, Int3 last);

  /// Hints that these bricks come after those that were begun: starts the disk for what is not
  /// here. Where they are stored is looked up beside the decoding; begun.wait() throws what goes
  /// wrong with it.
  void will_need(CachedBricks& begun, std::vector<Int3> bricks);

  /// Bricks read and decoded so far, and how many different ones.
  std::uint64_t reads() const { return slots_.reads(); }
  std::uint64_t bricks_read() const { return slots_.bricks_read(); }

 private:
  friend class CachedBricks;
  std::uint64_t key(Int3 brick) const {
    return static_cast<std::uint64_t>(linear_index(brick, lattice_.bricks()));
  }
  std::byte* place(Int3 brick);
  void grow();

  const StoreReader& store_;
  const int level_;
  const Lattice lattice_;
  const std::size_t capacity_;
  const BrickCheck check_;
  BrickSlots slots_;
  struct Free {
    void operator()(std::byte* slab) const { std::free(slab); }
  };
  std::vector<std::unique_ptr<std::byte, Free>> slabs_;  ///< memory of many bricks each
  std::size_t places_ = 0;                               ///< that there is memory for
};

}  // namespace isobrick
