#pragma once

#include <cstddef>
#include <optional>
#include <span>

#include <isobrick/store_reader.h>
#include "bricks/ranges/lru_cache.h"

namespace isobrick::inline v0 {

/// Reads bricks of a level and compares them with their stored ranges: a brick that lies at the
/// place of another, or comes from another store, has a right checksum and makes a wrong mesh. The
/// samples of a brick must lie within its range, which the first layer of its neighbours may have
/// widened. Thread-safe.
class BrickReader {
 public:
  /// `store` must outlive it.
  BrickReader(const StoreReader& store, int level);

  const Lattice& lattice() const { return lattice_; }
  /// As StoreReader::read_brick. Throws DamageError, with the brick and its place, for samples
  /// outside of the range.
  bool read(Int3 brick, std::byte* out) const;
  /// Whether bricks can be read without being decoded.
  bool is_packed() const { return store_.is_packed(level_); }
  /// As StoreReader::read_packed. What decodes the brick must compare its samples
  /// with stored_range().
  std::optional<std::size_t> read_packed(Int3 brick, std::span<std::byte> out) const;
  /// Everything where the store has no ranges.
  ValueRange<double> stored_range(Int3 brick) const;

  /// Whether will_need() can gain anything.
  bool reads_disk() const { return !store_.reads_memory(); }
  /// Whether bricks come from another machine.
  bool reads_network() const { return store_.storage()->is_remote(); }
  /// Hints to the disk that these bricks are read soon.
  void will_need(std::span<const Int3> bricks) const;

 private:
  void check(Int3 brick, const std::byte* samples) const;
  [[noreturn]] void fail(Int3 brick, const ValueRange<double>& stored,
                         const ValueRange<double>& found) const;

  const StoreReader& store_;
  const int level_;
  const Lattice lattice_;
  mutable LruCache<RangeTable> tables_;
};

}  // namespace isobrick
