#include "bricks/zarr/shard_index.h"

#include <fmt/format.h>

#include <cstring>

#include <isobrick/error.h>
#include "bricks/zarr/codec.h"

namespace isobrick::inline v0 {

namespace {

std::uint32_t checksum(std::span<const std::byte> body, std::span<const std::byte> bound) {
  if (bound.empty()) return crc32c(body);
  std::vector<std::byte> all(body.begin(), body.end());
  all.insert(all.end(), bound.begin(), bound.end());
  return crc32c(all);
}

}  // namespace

static_assert(sizeof(ShardIndex::Entry) == ShardIndex::kEntryBytes);

std::vector<std::byte> ShardIndex::encode(std::span<const std::byte> bound) const {
  std::vector<std::byte> bytes(encoded_size(entries_.size(), true));
  const std::size_t body = entries_.size() * kEntryBytes;
  std::memcpy(bytes.data(), entries_.data(), body);
  const std::uint32_t crc = checksum(std::span(bytes).first(body), bound);
  std::memcpy(bytes.data() + body, &crc, kCrcBytes);
  return bytes;
}

ShardIndex ShardIndex::decode(std::span<const std::byte> bytes, bool with_crc,
                              std::uint64_t file_size, std::span<const std::byte> bound) {
  const std::size_t tail = with_crc ? kCrcBytes : 0;
  if (bytes.size() < tail || (bytes.size() - tail) % kEntryBytes != 0)
    throw DamageError(fmt::format("a shard index cannot have {} bytes", bytes.size()));
  const auto body = bytes.first(bytes.size() - tail);
  if (with_crc) {
    std::uint32_t stored;
    std::memcpy(&stored, bytes.data() + body.size(), kCrcBytes);
    if (const std::uint32_t crc = checksum(body, bound); crc != stored)
      throw DamageError(
          fmt::format("checksum of the shard index is {:08x}, must be {:08x}", crc, stored));
  }
  ShardIndex index(body.size() / kEntryBytes);
  std::memcpy(index.entries_.data(), body.data(), body.size());
  for (std::size_t i = 0; i < index.size(); ++i) {
    const Entry entry = index[i];
    if (!entry.absent() && (entry.offset > file_size || entry.size > file_size - entry.offset))
      throw DamageError(
          fmt::format("shard index: brick {} at {} + {} does not lie within the file's {} bytes", i,
                      entry.offset, entry.size, file_size));
  }
  return index;
}

std::uint64_t ShardIndex::brick_bytes() const {
  // Overlapping entries of a foreign shard could wrap the sum; nobody is hurt by that.
  std::uint64_t sum = 0;
  for (const Entry& entry : entries_)
    if (!entry.absent()) sum += entry.size;
  return sum;
}

}  // namespace isobrick
