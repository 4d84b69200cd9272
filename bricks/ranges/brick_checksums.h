#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include <isobrick/level_info.h>
#include "bricks/ranges/item_array.h"
#include "bricks/ranges/lru_cache.h"
#include "bricks/zarr/codec.h"

// The checksums of a level's bricks as they are encoded: what a whole brick at the place of
// another, or of another store, is recognised by.

namespace isobrick::inline v0 {

/// Where they lie in a store whose ranges lie below `additions`, a key.
std::string brick_checksum_folder(const std::string& additions, int level);

/// What stands for an absent brick.
inline constexpr std::uint32_t kAbsentBrick = 0;

/// The checksum of an encoded brick that is whole: the one that it ends with, where its codec chain
/// ends so; else it is computed.
std::uint32_t brick_checksum(const CodecChain& chain, std::span<const std::byte> encoded);

/// Bytes that an ItemArrayWriter of a level's checksums gathers while shards are finished in the
/// order of z.
std::size_t brick_checksum_bytes(const LevelInfo& level);

/// Reads the checksums of one level and keeps some of them. Thread-safe.
class BrickChecksums {
 public:
  /// As ItemArrayReader.
  BrickChecksums(std::shared_ptr<const Storage> storage, std::string folder, Int3 bricks,
                 std::uint32_t crc32c);

  bool exists() const { return array_.exists(); }
  /// Throws as ItemArrayReader::read_chunk() does.
  std::uint32_t at(Int3 brick, std::atomic<std::uint64_t>& bytes_read) const;

 private:
  Int3 bricks_;
  ItemArrayReader array_;
  mutable LruCache<std::vector<std::byte>> chunks_;
};

}  // namespace isobrick
