#pragma once

#include <cstddef>
#include <cstdint>
#include <list>
#include <memory>
#include <mutex>
#include <unordered_map>

#include "isobrick/viewer/node_grid.h"

namespace isobrick {

class BrickSource;
struct RangeTable;

/// Ranges of 16³ blocks, read in the chunks in which they are stored; those that were asked for
/// last stay. Thread-safe.
class BlockRanges {
 public:
  /// `budget` in bytes; one chunk is kept in any case.
  BlockRanges(std::shared_ptr<const BrickSource> source, std::uint64_t budget);

  /// The ranges of the chunk that holds a block of a stored level. Throws what reading throws.
  std::shared_ptr<const RangeTable> around(int level, Int3 block);

 private:
  /// A chunk: its stored level and its place among the chunks.
  using Key = NodeKey;
  struct Chunk {
    std::once_flag once;
    std::shared_ptr<const RangeTable> table;
  };
  struct Entry {
    std::shared_ptr<Chunk> chunk;
    std::list<Key>::iterator order;
  };

  std::shared_ptr<Chunk> find(const Key& key);
  std::shared_ptr<const RangeTable> read(const Key& key) const;

  std::shared_ptr<const BrickSource> source_;
  std::size_t most_;
  std::mutex mutex_;
  std::unordered_map<Key, Entry, NodeKeyHash> chunks_;
  std::list<Key> order_;  ///< most recently used first
};

}  // namespace isobrick
