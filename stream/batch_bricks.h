#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include <isobrick/lattice.h>
#include "core/flat_map.h"
#include "stream/brick_slots.h"

namespace isobrick::inline v0 {

/// A brick and the slot that it is decoded to.
struct BrickLoad {
  Int3 brick;
  std::byte* slot = nullptr;
};

/// The bricks that a batch of tiles holds in slots of memory, whatever backend decodes them. Only
/// find() is thread-safe; the others need the lock of the slots, if they have one.
class BatchBricks final : public BrickLookup {
 public:
  /// Holds those of `bricks` that are resident; no brick is there twice. `last` is the last tile
  /// of the batch: bricks that neither it nor a later tile needs are dropped when nobody holds
  /// them. `slots` must outlive it.
  BatchBricks(BrickSlots& slots, std::span<const Int3> bricks, Int3 last);
  BatchBricks(const BatchBricks&) = delete;
  BatchBricks& operator=(const BatchBricks&) = delete;
  ~BatchBricks() override;

  /// Bricks that were not resident, so that the batch decodes them.
  std::size_t loads() const { return bricks_.size() - first_load_; }
  /// Bricks that have no slot yet.
  std::size_t missing() const { return bricks_.size() - held_; }
  /// Takes a slot for the next missing brick. The slot is null when all are held.
  BrickLoad place();
  /// The decoder found no such brick in the store, and frees its slot.
  void set_absent(Int3 brick) { slots_.set_absent(brick); }
  /// All bricks have been decoded. Counts them, and makes find() valid; called once.
  void set_decoded();

  const std::byte* find(Int3 brick) const override;

 private:
  BrickSlots& slots_;
  const Int3 grid_;
  std::vector<Int3> bricks_;  ///< first those that were resident
  std::size_t first_load_, held_;
  FlatMap<const std::byte*> samples_;
};

}  // namespace isobrick
