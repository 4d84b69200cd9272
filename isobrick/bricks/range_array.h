#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <map>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <tuple>
#include <vector>

#include "isobrick/bricks/array_metadata.h"
#include "isobrick/bricks/publisher.h"
#include "isobrick/bricks/range_table.h"

namespace isobrick {

/// Where the ranges of bricks and of blocks lie in a store.
std::filesystem::path brick_range_folder(const std::filesystem::path& store, int level);
std::filesystem::path block_range_folder(const std::filesystem::path& store, int level);

/// Writes one range array. Chunks are collected in memory and written as soon
/// as all their items are known. Thread-safe.
class RangeArrayWriter {
 public:
  RangeArrayWriter(std::filesystem::path folder, Int3 items, ScalarType type, Publisher& publisher);

  /// Pairs (lo, hi), C order [z, y, x, 2] over `box`; each item exactly once.
  void put(Box3 box, std::span<const std::byte> pairs);
  /// Writes the chunks' checksums and the metadata if there are ranges at all; the checksum of
  /// those checksums, which tells these ranges from others. Throws Error when only some are there.
  std::optional<std::uint32_t> finish();

 private:
  struct Chunk {
    std::vector<std::byte> bytes;
    Index missing = 0;  // items
  };
  void write_chunk(Int3 c, const Chunk& chunk);

  std::filesystem::path folder_;
  Int3 items_;
  ArrayMetadata metadata_;
  Publisher& publisher_;
  std::mutex mutex_;
  std::map<std::tuple<Index, Index, Index>, Chunk> chunks_;  // begun but not complete
  Index written_ = 0;                                        // chunks
  std::vector<std::uint32_t> checksums_;                     // of all chunks, C order [z, y, x]
};

/// Reads one range array.
class RangeArrayReader {
 public:
  /// Throws Error when the array does not exist, DamageError when it is not the
  /// range array of so many items. `crc32c` is what RangeArrayWriter::finish() returned.
  RangeArrayReader(std::filesystem::path folder, Int3 items, ScalarType type, std::uint32_t crc32c);

  /// Throws DamageError naming the file when it is damaged, or a chunk of another place or store.
  RangeTable read(Box3 box, std::atomic<std::uint64_t>& bytes_read) const;

 private:
  void read_checksums(std::uint32_t crc32c);

  std::filesystem::path folder_;
  Int3 items_;
  ArrayMetadata metadata_;
  std::vector<std::uint32_t> checksums_;  ///< of all chunks, C order [z, y, x]
  std::string wrong_;                     ///< why there are none; empty: all is well
};

}  // namespace isobrick
