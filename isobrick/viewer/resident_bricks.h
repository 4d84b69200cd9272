#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <exception>
#include <list>
#include <memory>
#include <mutex>
#include <unordered_map>
#include <vector>

#include "isobrick/viewer/brick_source.h"

namespace isobrick {

/// Thrown out of work that nobody wants any more. Says nothing to a user.
class Abandoned final : public std::exception {};

/// Whether somebody still wants the work that a thread is at; asked between bricks.
class Wanted {
 public:
  virtual ~Wanted() = default;
  /// Throws Abandoned when nobody does.
  virtual void check() const = 0;
};

/// A decoded brick, native byte order; empty when it is absent.
using BrickSamples = std::vector<std::byte>;

/// Decoded bricks of all levels under one budget, the least recently used dropped
/// first. Thread-safe: threads that want the same brick wait for the one that
/// reads it. (stream/brick_cache.h serves one caller and one level at a time.)
class ResidentBricks {
 public:
  /// `budget` in bytes; what is in use counts, too. A brick that does not fit beside
  /// those in use is given out all the same and dropped at once afterwards.
  ResidentBricks(std::shared_ptr<const BrickSource> source, std::uint64_t budget);

  /// The brick, read and decoded by the caller's thread if need be. Throws
  /// Abandoned, or what reading throws: a brick that is damaged is not read twice.
  std::shared_ptr<const BrickSamples> get(int level, Int3 brick, const Wanted& wanted);
  /// The same, but null at once where another thread is reading it.
  std::shared_ptr<const BrickSamples> get_unless_busy(int level, Int3 brick, const Wanted& wanted);
  /// The brick if it is there.
  std::shared_ptr<const BrickSamples> find(int level, Int3 brick);
  /// Whether all bricks of `box` (in bricks) are there.
  bool resident(int level, Box3 box) const;
  /// Drops what is there; from now on nothing is kept.
  void close();
  /// Hints that bricks of `box` are read soon.
  void will_need(int level, Box3 box) const;

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

  std::shared_ptr<const BrickSamples> get(const Key& key, const Wanted& wanted, bool may_wait);
  std::shared_ptr<const BrickSamples> read(const Key& key, std::unique_lock<std::mutex>& lock);
  std::shared_ptr<const BrickSamples> load(const Key& key);
  void make_room(std::uint64_t bytes);

  std::shared_ptr<const BrickSource> source_;
  std::uint64_t budget_;
  mutable std::mutex mutex_;
  std::condition_variable loaded_;
  std::unordered_map<Key, Entry, KeyHash> entries_;
  std::list<Key> order_;  ///< most recently used first; only what is loaded
  Counters counters_;
};

}  // namespace isobrick
