#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace isobrick::inline v0 {

/// The index of a shard as Zarr's sharding_indexed codec stores it: offset and
/// length of each brick, C order [z, y, x], little endian; both 2⁶⁴−1 for an
/// absent one; then, in our stores always, the CRC-32C of all that.
class ShardIndex {
 public:
  struct Entry {
    std::uint64_t offset = kAbsent, size = kAbsent;
    bool absent() const { return offset == kAbsent && size == kAbsent; }
    friend bool operator==(const Entry&, const Entry&) = default;
  };
  static constexpr std::uint64_t kAbsent = ~std::uint64_t{0};
  static constexpr std::size_t kEntryBytes = 16, kCrcBytes = 4;

  explicit ShardIndex(std::size_t bricks) : entries_(bricks) {}

  /// Bytes of the index of so many bricks.
  static std::uint64_t encoded_size(std::uint64_t bricks, bool with_crc) {
    return bricks * kEntryBytes + (with_crc ? kCrcBytes : 0);
  }
  /// `bound` enters the checksum though it is not stored: what else must be right.
  std::vector<std::byte> encode(std::span<const std::byte> bound = {}) const;
  /// Checks the checksum and that each brick lies within the `file_size` bytes
  /// of the shard. Throws DamageError saying what is wrong, not where.
  static ShardIndex decode(std::span<const std::byte> bytes, bool with_crc, std::uint64_t file_size,
                           std::span<const std::byte> bound = {});

  std::span<const Entry> entries() const { return entries_; }
  Entry& operator[](std::size_t i) { return entries_[i]; }
  const Entry& operator[](std::size_t i) const { return entries_[i]; }
  std::size_t size() const { return entries_.size(); }
  /// Bytes of all bricks together; with ours, all of the file but the index.
  std::uint64_t brick_bytes() const;

 private:
  std::vector<Entry> entries_;
};

}  // namespace isobrick
