#pragma once

#include <cstddef>
#include <memory>

#include <isobrick/store_reader.h>
#include "bricks/ranges/lru_cache.h"

namespace isobrick {

/// Compares decoded bricks with the ranges that the store has of them: a whole brick at the place
/// of another, or of another store, has a right checksum and makes a wrong mesh. A brick's own
/// samples must lie within its range, which the first layer of its neighbours may have widened.
/// Thread-safe.
class BrickCheck {
 public:
  BrickCheck(const StoreReader& store, int level);

  /// Throws DamageError naming the brick and where it lies. Without `samples` it is absent.
  void check(Int3 brick, const std::byte* samples) const;

 private:
  ValueRange<double> stored_range(Int3 brick) const;
  [[noreturn]] void fail(Int3 brick, const ValueRange<double>& stored,
                         const ValueRange<double>& found) const;

  const StoreReader& store_;
  const int level_;
  const Lattice lattice_;
  mutable LruCache<RangeTable> tables_;
};

}  // namespace isobrick
