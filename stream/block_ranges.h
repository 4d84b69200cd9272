#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <utility>

#include "bricks/ranges/lru_cache.h"
#include "stream/brick_source.h"

namespace isobrick::inline v0 {

/// Ranges of 16³ blocks, read in the chunks in which they are stored; the most
/// recently used stay. Thread-safe.
class BlockRanges {
 public:
  /// `budget` in bytes; one chunk is kept in any case.
  BlockRanges(std::shared_ptr<const BrickSource> source, std::uint64_t budget)
      : source_(std::move(source)), chunks_(budget) {}

  /// The ranges of the chunk that holds a block of a stored level. Throws what reading throws.
  std::shared_ptr<const RangeTable> around(int level, Int3 block);
  /// The same if they have been read, null otherwise. Neither reads nor waits.
  std::shared_ptr<const RangeTable> find(int level, Int3 block);
  /// Drops what is there.
  void clear() { chunks_.clear(); }

 private:
  /// The first thread that needs it reads it, while others read other chunks.
  struct Chunk {
    mutable std::once_flag once;
    mutable std::shared_ptr<const RangeTable> table;
    mutable std::atomic<bool> read = false;  ///< for those who did not wait for `once`
  };

  std::uint64_t number(int level, Int3 chunk) const;

  std::shared_ptr<const BrickSource> source_;
  LruCache<Chunk> chunks_;
};

}  // namespace isobrick
