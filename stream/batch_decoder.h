#pragma once

#include <atomic>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <exception>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <thread>
#include <vector>

#include <isobrick/store_reader.h>
#include "stream/batch_bricks.h"
#include "stream/batch_lookahead.h"
#include "stream/brick_memory.h"
#include "stream/brick_reader.h"
#include "stream/brick_slots.h"
#include "stream/job_queue.h"
#include "stream/tile_stream.h"

namespace isobrick::inline v0 {

class BatchDecoder;

/// Tiles and their decoded bricks, which stay in place until this is destroyed, by any thread and
/// before the decoder.
class DecodedBatch final : public BrickLookup {
 public:
  DecodedBatch(BatchDecoder& decoder, TileBatch batch)
      : decoder_(decoder), batch_(std::move(batch)) {}
  DecodedBatch(const DecodedBatch&) = delete;
  DecodedBatch& operator=(const DecodedBatch&) = delete;
  ~DecodedBatch() override;

  /// Tiles that any isovalue touches.
  std::span<const TileWork> tiles() const { return batch_.tiles; }
  /// Those that an isovalue of the planner's stream touches.
  std::span<const TileWork> tiles_of(std::size_t isovalue) const {
    return batch_.tiles_of[isovalue];
  }
  const std::byte* find(Int3 brick) const override { return bricks_->find(brick); }

 private:
  friend class BatchDecoder;
  BatchDecoder& decoder_;
  TileBatch batch_;
  std::optional<BatchBricks> bricks_;     ///< once the batch is begun
  std::atomic<std::size_t> pending_ = 0;  ///< bricks to decode; not under the decoder's lock
  bool begun_ = false;                    ///< all of its bricks are held
};

/// Decodes the bricks of batch after batch, some batches ahead of the caller, so that no core waits
/// at the end of one. Planning and decoding have threads of their own.
class BatchDecoder {
 public:
  /// `threads` threads decode. At most `capacity` bricks are held at a time, which must be enough
  /// for any batch. They lie in `memory`, from which the decoder takes pieces of piece_bricks()
  /// when it needs them. One thread, not the caller's, uses the planner.
  BatchDecoder(const StoreReader& store, int level, BatchPlanner& planner, Index reach,
               std::size_t capacity, int threads, BrickMemory& memory);
  /// Stops. All batches must have been destroyed.
  ~BatchDecoder();

  /// Waits for the next batch, decoded; null at the end. Throws the errors of reading, decoding
  /// and planning.
  std::shared_ptr<const DecodedBatch> next();

  /// Memory for bricks so far; after the end, a last piece may still follow.
  std::uint64_t memory_bytes() const;
  /// Bricks read and decoded, and how many different ones. After the end.
  std::uint64_t reads() const { return slots_.reads(); }
  std::uint64_t bricks_read() const { return slots_.bricks_read(); }

  /// Bricks in a piece of memory: large pieces are faster to allocate, but must not take all of a
  /// small capacity.
  static std::size_t piece_bricks(const Lattice& lattice, std::size_t capacity);

 private:
  friend class DecodedBatch;
  using Batch = std::shared_ptr<DecodedBatch>;

  void plan();
  bool next_planned(TileBatch& batch);
  void begin(const Batch& batch);
  void load(const Batch& batch, std::vector<BrickLoad> loads);
  BrickLoad place(BatchBricks& bricks);
  void hint(const TileBatch& batch);
  void grow_if_short();
  void grow(std::size_t count);
  void work(int thread);
  void decode(int thread, DecodedBatch& batch, const std::vector<BrickLoad>& loads);
  std::shared_ptr<const DecodedBatch> next_decoded();
  bool load_brick(int thread, const BrickLoad& load);
  void check_device(bool all);
  void release(DecodedBatch& batch);
  void fail(std::exception_ptr error);
  template <class Ready>
  void wait(std::unique_lock<std::mutex>& lock, const Ready& ready);

  const BrickReader reader_;
  BatchLookahead batches_planned_;
  const std::size_t capacity_;
  const int threads_count_;
  const std::size_t bricks_of_job_;
  BrickMemory& memory_;

  // Decoders take jobs, and end most of them, without the lock of the bookkeeping: planning and
  // next() hold that for long.
  JobQueue jobs_;
  mutable std::mutex mutex_;  ///< of all below
  std::condition_variable changed_;
  BrickSlots slots_;
  std::deque<Batch> batches_;      ///< begun, or next to be, and not taken
  std::size_t ahead_ = 0;          ///< bricks that are decoded for those
  std::size_t pending_slots_ = 0;  ///< whose memory is being allocated
  bool planned_ = false, stop_ = false;
  std::exception_ptr error_;

  std::vector<std::thread> threads_;
};

}  // namespace isobrick
