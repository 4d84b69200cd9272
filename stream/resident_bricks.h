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

namespace isobrick {

/// Thrown out of work that nobody wants any more. Says nothing to a user.
class OperationCancelled final : public std::exception {};

/// Whether somebody still wants the work that a thread is at; asked between bricks.
class CancellationToken {
 public:
  virtual ~CancellationToken() = default;
  /// Throws OperationCancelled when nobody does.
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

/// Decoded bricks of all levels under one budget, the least recently used dropped
/// first. Thread-safe: threads that want the same brick wait for the one that
/// reads it. (stream/brick_cache.h serves one caller and one level at a time.)
class ResidentBricks {
 public:
  /// `budget` in bytes; what is in use counts, too, and a small part is for ranges. A brick that
  /// does not fit beside those in use is given out all the same and dropped at once afterwards.
  ResidentBricks(std::shared_ptr<const BrickSource> source, std::uint64_t budget);

  /// The brick, read and decoded by the caller's thread if need be. Throws
  /// OperationCancelled, or what reading throws: a brick that is damaged is not read twice.
  std::shared_ptr<const BrickSamples> get(int level, Int3 brick, const CancellationToken& token);
  /// The same, but null at once where another thread is reading it.
  std::shared_ptr<const BrickSamples> get_unless_busy(int level, Int3 brick,
                                                      const CancellationToken& token);
  /// Reads those of these bricks that are missing. Threads that are in here at the same time read
  /// one another's, whoever came first first, then those that will_need() named while there is room
  /// for them, rather than wait for what others are reading. Does nothing where fewer than two
  /// bricks are missing, which get() reads or waits for, nor where they would take much of the
  /// budget: then they would displace one another. Throws OperationCancelled; what cannot be read
  /// says so when it is got.
  void read_together(int level, std::span<const Int3> bricks, const CancellationToken& token);
  /// The brick if it is there.
  std::shared_ptr<const BrickSamples> find(int level, Int3 brick);
  /// Whether all bricks of `box` (in bricks, within the lattice) are there. Waits for nobody, like
  /// the next two: bricks may come and go while it looks.
  bool resident(int level, Box3 box) const;
  /// Whether at least half of these are.
  bool half_resident(int level, std::span<const Int3> bricks) const;
  bool half_resident(int level, Box3 bricks) const;
  /// Drops what is there, ranges as well; from now on no brick is kept.
  void close();
  /// The ranges of blocks around this one, those of its node of 64³ cells among them.
  std::shared_ptr<const RangeTable> block_ranges(int level, Int3 block) {
    return ranges_.around(level, block);
  }
  /// The same if they have been read, null otherwise.
  std::shared_ptr<const RangeTable> known_block_ranges(int level, Int3 block) {
    return ranges_.find(level, block);
  }
  /// Says that the brick is wanted soon, unless it is there or somebody has said so: hints it to
  /// the disk, and threads that would wait in read_together() read it meanwhile, those first that
  /// were named first. Together they take an eighth of the budget at most; what was named first is
  /// forgotten for what was named last. A brick that is larger is hinted only.
  void will_need(int level, Int3 brick);
  /// What will_need() named is not wanted any more.
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

  /// What a thread in read_together() wants.
  struct Request {
    int level;
    std::span<const Int3> bricks;
    std::size_t next = 0;  ///< the first so many are there, or being read
  };
  /// One of both.
  struct LoadResult {
    std::shared_ptr<const BrickSamples> samples;
    std::exception_ptr failure;
  };

  std::shared_ptr<const BrickSamples> get(const Key& key, const CancellationToken& token,
                                          bool may_wait);
  LoadResult read(const Key& key, std::unique_lock<std::mutex>& lock);
  std::optional<Key> next_wanted();
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
  BrickSet resident_;     ///< those of entries_ that are loaded; may be asked without the lock
  std::list<Key> order_;  ///< most recently used first; only what is loaded
  std::list<Request> requests_;
  /// That will_need() named and nobody has begun to read, those first that were named first.
  std::list<Key> prefetch_queue_;
  std::unordered_map<Key, std::list<Key>::iterator, KeyHash> soon_places_;  ///< in `soon_`
  std::uint64_t soon_bytes_ = 0;                                            ///< of those
  Counters counters_;
};

}  // namespace isobrick
