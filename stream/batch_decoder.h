#pragma once

#include <atomic>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <exception>
#include <memory>
#include <mutex>
#include <span>
#include <thread>
#include <vector>

#include <isobrick/store_reader.h>
#include "core/flat_map.h"
#include "stream/brick_check.h"
#include "stream/brick_memory.h"
#include "stream/brick_slots.h"
#include "stream/job_queue.h"
#include "stream/tile_stream.h"

namespace isobrick {

class BatchDecoder;

/// Tiles and their decoded bricks, which stay where they are until this is destroyed (by any
/// thread, but before the decoder).
class DecodedBatch final : public BrickLookup {
 public:
  DecodedBatch(BatchDecoder& decoder, TileBatch batch)
      : decoder_(decoder), batch_(std::move(batch)) {}
  DecodedBatch(const DecodedBatch&) = delete;
  DecodedBatch& operator=(const DecodedBatch&) = delete;
  ~DecodedBatch() override;

  /// That any isovalue touches.
  std::span<const TileWork> tiles() const { return batch_.tiles; }
  /// Those that an isovalue of the planner's stream touches.
  std::span<const TileWork> tiles_of(std::size_t isovalue) const {
    return batch_.tiles_of[isovalue];
  }
  const std::byte* find(Int3 brick) const override;

 private:
  friend class BatchDecoder;
  BatchDecoder& decoder_;
  TileBatch batch_;
  Int3 grid_;
  FlatMap<const std::byte*> samples_;
  std::size_t held_ = 0;                  ///< of its bricks, the first so many
  std::size_t loads_ = 0;                 ///< of its bricks, the last so many are decoded for it
  std::atomic<std::size_t> missing_ = 0;  ///< of those, not done; not under the decoder's lock
  bool begun_ = false;                    ///< all of its bricks are held
};

/// Decodes the bricks of batch after batch, some batches ahead of whoever takes them, so
/// that no core waits at the end of one. Planning and decoding have threads of their own.
class BatchDecoder {
 public:
  /// So many threads decode; at most `capacity` bricks are held at a time, which must be
  /// enough for any batch. They lie in `memory`, of which pieces of slab_bricks() are asked
  /// for when they are needed. The planner is used by one thread only, not the caller's.
  BatchDecoder(const StoreReader& store, int level, BatchPlanner& planner, Index reach,
               std::size_t capacity, int threads, BrickMemory& memory);
  /// Stops; all batches have been destroyed.
  ~BatchDecoder();

  /// The next batch, decoded; null at the end. Waits for it, and throws what went wrong
  /// in reading, decoding or planning.
  std::shared_ptr<const DecodedBatch> next();

  /// Memory for bricks that there is by now; after the end a last piece may still be coming.
  std::uint64_t memory_bytes() const;
  /// Bricks read and decoded, and how many different ones. After the end.
  std::uint64_t reads() const { return slots_.reads(); }
  std::uint64_t bricks_read() const { return slots_.bricks_read(); }

  /// Bricks whose memory is got at a time: large pieces are quicker to get, but they
  /// are not to be all of a small capacity.
  static std::size_t slab_bricks(const Lattice& lattice, std::size_t capacity);

 private:
  friend class DecodedBatch;
  using Batch = std::shared_ptr<DecodedBatch>;
  struct Load {
    Int3 brick;
    std::byte* place;
  };

  void plan();
  bool next_planned(TileBatch& batch);
  void begin(const Batch& batch);
  void load(const Batch& batch, std::vector<Load> loads);
  std::byte* place(Int3 brick);
  void hint(const TileBatch& batch);
  void grow_if_short();
  void grow(std::size_t count);
  void work(int thread);
  void decode(int thread, DecodedBatch& batch, const std::vector<Load>& loads);
  void release(const DecodedBatch& batch);
  void fail(std::exception_ptr error);
  template <class Ready>
  void wait(std::unique_lock<std::mutex>& lock, const Ready& ready);

  const StoreReader& store_;
  const int level_;
  const Lattice lattice_;
  BatchPlanner& planner_;
  const std::size_t capacity_;
  const int threads_count_;
  const std::size_t bricks_of_job_;
  BrickMemory& memory_;
  const BrickCheck check_;

  // Decoders take jobs and mostly end them without the lock of the books, which planning and
  // handing on hold for long.
  JobQueue jobs_;
  mutable std::mutex mutex_;  ///< of all below
  std::condition_variable changed_;
  BrickSlots slots_;
  std::deque<Batch> batches_;    ///< begun or about to be, not taken
  std::size_t ahead_ = 0;        ///< bricks decoded for those, or being so
  std::size_t slots_count_ = 0;  ///< bricks that there is memory for, or soon
  std::size_t coming_ = 0;       ///< of those, not there yet
  std::uint64_t memory_bytes_ = 0;
  bool planned_ = false, stop_ = false;
  std::exception_ptr error_;
  std::vector<std::shared_ptr<std::byte>> slabs_;

  std::vector<std::thread> threads_;
};

}  // namespace isobrick
