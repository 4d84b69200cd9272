#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <tuple>
#include <vector>

#include <isobrick/storage.h>
#include "bricks/ranges/range_format.h"
#include "bricks/zarr/array_metadata.h"
#include "bricks/zarr/publisher.h"

namespace isobrick::inline v0 {

/// Writes an array of items, one for each brick or block of a level: ranges or checksums. Chunks
/// are collected in memory and written as soon as all their items are known. Thread-safe.
class ItemArrayWriter {
 public:
  /// `array` is one of those of range_format.h for so many items.
  ItemArrayWriter(std::filesystem::path folder, Int3 items, ArrayMetadata array,
                  Publisher& publisher);

  /// Items of `box`, C order [z, y, x]; each item exactly once.
  void put(Box3 box, std::span<const std::byte> items);
  /// A chunk as it is encoded, of the array of another store with the same items; in place of
  /// putting them.
  void put_encoded_chunk(Int3 c, std::span<const std::byte> encoded);
  /// Items that were not put are zeros, in all chunks that end at or below `z` (in items).
  void fill_below(Index z);
  /// Writes the chunks' checksums and the metadata if there are items at all; the checksum of
  /// those checksums, which identifies these items. Throws Error when only some are there.
  std::optional<std::uint32_t> finish();

 private:
  struct Chunk {
    std::vector<std::byte> bytes;
    Index missing = 0;  // items
  };
  void write_chunk(Int3 c, std::span<const std::byte> decoded);
  void write_encoded(Int3 c, std::span<const std::byte> encoded);
  std::size_t number(Int3 c) const {
    return static_cast<std::size_t>(linear_index(c, chunk_grid_));
  }

  std::filesystem::path folder_;
  Int3 items_, chunk_extent_, chunk_grid_;
  ArrayMetadata array_;
  Publisher& publisher_;
  std::mutex mutex_;
  std::map<std::tuple<Index, Index, Index>, Chunk> chunks_;  // begun but not complete
  std::vector<bool> complete_;                               // chunks that are or will be written
  Index complete_count_ = 0, filled_below_ = 0;              // chunks; layers of them
  std::vector<std::uint32_t> checksums_;                     // of all chunks, C order [z, y, x]
};

/// Reads such an array. Thread-safe.
class ItemArrayReader {
 public:
  /// Hints that the array in `folder` is opened soon.
  static void will_open(const Storage& storage, const std::string& folder);
  /// Throws DamageError when the array is not `array`. `folder` is a key, `crc32c` what
  /// ItemArrayWriter::finish() returned.
  ItemArrayReader(std::shared_ptr<const Storage> storage, std::string folder, Int3 items,
                  ArrayMetadata array, std::uint32_t crc32c);

  /// Whether the array is there, damaged or not.
  bool exists() const { return exists_; }
  /// How messages name the array.
  std::string name() const { return storage_->name_of(folder_); }
  /// Throws UsageError for a box that is empty or goes beyond the array.
  void check_box(Box3 box) const;
  /// Items of a chunk.
  Int3 chunk_extent() const { return range_chunk_extent(items_); }
  /// A chunk's items. Throws DamageError naming the file when it is missing, damaged, or a chunk of
  /// another place or store.
  std::vector<std::byte> read_chunk(Int3 c, std::atomic<std::uint64_t>& bytes_read) const;
  /// Checks all chunks, as read_chunk() does, and hands them on as they are.
  void copy_to(ItemArrayWriter& writer) const;

 private:
  struct ReadChunk {
    std::string encoded;
    std::vector<std::byte> decoded;
  };
  ReadChunk read(Int3 c) const;
  void read_checksums(std::uint32_t crc32c);

  std::shared_ptr<const Storage> storage_;
  std::string folder_;
  Int3 items_;
  ArrayMetadata array_;
  std::vector<std::uint32_t> checksums_;  ///< of all chunks, C order [z, y, x]
  bool exists_ = true;
  std::string wrong_;  ///< why there are no checksums; empty: all is well
};

}  // namespace isobrick
