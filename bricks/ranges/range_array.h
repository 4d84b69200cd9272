#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include <isobrick/range_table.h>
#include "bricks/ranges/item_array.h"
#include "bricks/ranges/lru_cache.h"

namespace isobrick::inline v0 {

/// Where the ranges of bricks and of blocks lie in a store, below `additions`: all are keys.
std::string brick_range_folder(const std::string& additions, int level);
std::string block_range_folder(const std::string& additions, int level);

/// Reads an array of ranges.
class RangeArrayReader {
 public:
  /// As ItemArrayReader.
  RangeArrayReader(std::shared_ptr<const Storage> storage, std::string folder, Int3 items,
                   ScalarType type, std::uint32_t crc32c);

  bool exists() const { return array_.exists(); }
  /// Throws as ItemArrayReader::read_chunk() does.
  RangeTable read(Box3 box, std::atomic<std::uint64_t>& bytes_read) const;

 private:
  using Chunk = std::vector<std::byte>;
  std::shared_ptr<const Chunk> chunk(Int3 c, std::atomic<std::uint64_t>& bytes_read) const;

  ScalarType type_;
  Int3 chunk_grid_;
  ItemArrayReader array_;
  /// Of arrays whose chunks are no cubes: callers read cubes, many of which lie in one chunk.
  mutable LruCache<Chunk> chunks_;
};

}  // namespace isobrick
