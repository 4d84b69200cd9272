#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <exception>
#include <list>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <unordered_map>

#include "stream/block_ranges.h"
#include "stream/brick_set.h"
#include "stream/brick_source.h"

namespace isobrick::inline v0 {

/// Thrown to unwind cancelled work; never shown to users.
class OperationCancelled final : public std::exception {};

/// Whether an operation was cancelled. Its thread checks that between bricks.
class CancellationToken {
 public:
  virtual ~CancellationToken() = default;
  /// Throws OperationCancelled when it was.
  virtual void check() const = 0;
};

/// A decoded brick, native byte order; empty when it is absent.
class BrickSamples {
 public:
  /// Of no particular value.
  explicit BrickSamples(std::size_t bytes)
      : bytes_(std::make_unique_for_overwrite<std::byte[]>(bytes)), size_(bytes) {}

  void clear() {
    bytes_.reset();
    size_ = 0;
  }
  bool empty() const { return size_ == 0; }
  std::size_t size() const { return size_; }
  std::byte* data() { return bytes_.get(); }
  const std::byte* data() const { return bytes_.get(); }

 private:
  std::unique_ptr<std::byte[]> bytes_;
  std::size_t size_;
};

/// Decoded bricks of all levels under one budget; the least recently used is dropped first.
/// Thread-safe: threads that need the same brick wait for the one that reads it. (BrickCache serves
/// one caller and one level.)
class ResidentBricks {
 public:
  /// `budget` in bytes includes the bricks in use, and a small part for ranges. A brick that does
  /// not fit beside those in use is returned all the same, and dropped after its use.
  ResidentBricks(std::shared_ptr<const BrickSource> source, std::uint64_t budget);

  /// The brick, which the caller's thread reads and decodes if it is missing. Throws
  /// OperationCancelled, or the error of reading: a damaged brick is not read twice.
  std::shared_ptr<const BrickSamples> get(int level, Int3 brick, const CancellationToken& token);
  /// The same, but null at once where another thread is reading it.
  std::shared_ptr<const BrickSamples> get_unless_busy(int level, Int3 brick,
                                                      const CancellationToken& token);
  /// Reads those of these bricks that are missing. Concurrent callers read one another's bricks in
  /// the order of their calls. Then they read the bricks of will_need() while there is room, rather
  /// than wait for other threads. Does nothing where fewer than two bricks are missing: get() reads
  /// those. Does nothing either where the bricks would take much of the budget, and so displace one
  /// another. Throws OperationCancelled; get() reports the errors of reading.
  void read_together(int level, std::span<const Int3> bricks, const CancellationToken& token);
  /// The brick if it is resident.
  std::shared_ptr<const BrickSamples> find(int level, Int3 brick);
  /// Whether all bricks of `box` (in bricks, within the lattice) are resident. Takes no lock, like
  /// the next two: bricks may come and go meanwhile.
  bool resident(int level, Box3 box) const;
  /// Whether at least half of these are.
  bool half_resident(int level, std::span<const Int3> bricks) const;
  bool half_resident(int level, Box3 bricks) const;
  /// Drops all bricks and ranges; from now on no brick is kept.
  void close();
  /// The ranges of blocks around this one, those of its node of 64³ cells among them.
  std::shared_ptr<const RangeTable> block_ranges(int level, Int3 block) {
    return ranges_.around(level, block);
  }
  /// The same if they have been read, null otherwise.
  std::shared_ptr<const RangeTable> known_block_ranges(int level, Int3 block) {
    return ranges_.find(level, block);
  }
  /// Announces a brick that is needed soon, unless it is resident or announced. Hints it to the
  /// disk, and queues it: threads that would wait in read_together() read the queue from its front.
  /// The queue takes an eighth of the budget at most; a new brick displaces the oldest. A brick
  /// that is larger than that is hinted only.
  void will_need(int level, Int3 brick);
  /// Empties the queue of will_need().
  void forget_needs();

  const BrickSource& source() const { return *source_; }

  struct Counters {
    std::uint64_t bricks = 0, bytes = 0, peak_bytes = 0;
    std::uint64_t reads = 0;  ///< bricks read and decoded
    double read_seconds = 0;  ///< of reading and decoding, summed over threads
  };
  Counters counters() const;

 private:
  struct Key {
    int level;
    Int3 brick;
    friend bool operator==(const Key&, const Key&) = default;
  };
  struct KeyHash {
    std::size_t operator()(const Key& k) const;
  };
  struct Entry {
    bool loading = true;
    std::shared_ptr<const BrickSamples> samples;
    std::exception_ptr failure;
    std::list<Key>::iterator order;
  };

  /// The bricks of a thread in read_together().
  struct Request {
    int level;
    std::span<const Int3> bricks;
    std::size_t next = 0;  ///< the bricks before it are resident, or being read
  };
  /// One of both.
  struct LoadResult {
    std::shared_ptr<const BrickSamples> samples;
    std::exception_ptr failure;
  };

  std::shared_ptr<const BrickSamples> get(const Key& key, const CancellationToken& token,
                                          bool may_wait);
  LoadResult read(const Key& key, std::unique_lock<std::mutex>& lock);
  std::optional<Key> next_to_read();
  void forget_need(const Key& key);
  std::uint64_t brick_bytes(int level) const;
  bool over(const Request& request) const;
  std::shared_ptr<const BrickSamples> load(const Key& key);
  void make_room(std::uint64_t bytes);
  bool is_resident(const Key& key) const { return resident_.has(key.level, key.brick); }

  std::shared_ptr<const BrickSource> source_;
  BlockRanges ranges_;
  std::uint64_t budget_;
  mutable std::mutex mutex_;
  std::condition_variable loaded_;
  std::unordered_map<Key, Entry, KeyHash> entries_;
  BrickSet resident_;     ///< those of entries_ that are loaded; can be read without the lock
  std::list<Key> order_;  ///< most recently used first; only what is loaded
  std::list<Request> requests_;
  /// Bricks of will_need() that no thread has begun to read, oldest first.
  std::list<Key> prefetch_queue_;
  std::unordered_map<Key, std::list<Key>::iterator, KeyHash> prefetch_places_;
  std::uint64_t prefetch_bytes_ = 0;
  Counters counters_;
};

}  // namespace isobrick
