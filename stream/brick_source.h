#pragma once

#include <cstddef>
#include <memory>

#include <isobrick/store_reader.h>

namespace isobrick::inline v0 {

/// Where a scene has its samples from. Thread-safe. What StoreReader gives; an
/// interface so that a scene can be made of anything that has bricks and ranges.
class BrickSource {
 public:
  virtual ~BrickSource() = default;

  virtual const StoreInfo& info() const = 0;
  /// As StoreReader::read_brick: false when the brick is absent, DamageError
  /// when it is damaged.
  virtual bool read_brick(int level, Int3 brick, std::byte* out) const = 0;
  /// Hints that a brick is read soon. Does nothing by default.
  virtual void will_need(int, Int3) const {}
  /// Ranges of the bricks, and of the 16³ blocks, in `box` (in bricks, in blocks).
  virtual RangeTable brick_ranges(int level, Box3 box) const = 0;
  virtual RangeTable block_ranges(int level, Box3 box) const = 0;
  /// What reading bricks has cost so far, where that is known.
  virtual BrickTimes times() const { return {}; }
};

/// The bricks of a store. Throws Error when a level lacks ranges ('isobrick
/// index' adds them).
std::shared_ptr<const BrickSource> store_bricks(std::shared_ptr<const StoreReader> store);

}  // namespace isobrick
