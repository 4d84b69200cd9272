#include "stream/batch_bricks.h"

#include <algorithm>
#include <cassert>

#include "core/morton.h"

namespace isobrick::inline v0 {
namespace {

std::uint64_t key_of(Int3 brick, Int3 grid) {
  return static_cast<std::uint64_t>(linear_index(brick, grid));
}

}  // namespace

BatchBricks::BatchBricks(BrickSlots& slots, std::span<const Int3> bricks, Int3 last)
    : slots_(slots), grid_(slots.grid()), bricks_(bricks.begin(), bricks.end()) {
  // Resident bricks are held first, so that neither advance() nor place() drops one of them.
  const auto missing =
      std::stable_partition(bricks_.begin(), bricks_.end(), [&](Int3 b) { return slots_.hold(b); });
  first_load_ = held_ = static_cast<std::size_t>(missing - bricks_.begin());
  slots_.advance(morton_encode(last) + 1);
}

BatchBricks::~BatchBricks() {
  for (std::size_t i = 0; i < held_; ++i) slots_.release(bricks_[i]);
}

BrickLoad BatchBricks::place() {
  const Int3 brick = bricks_[held_];
  std::byte* const slot = slots_.place(brick);
  held_ += slot != nullptr;
  return {brick, slot};
}

void BatchBricks::set_decoded() {
  samples_ = FlatMap<const std::byte*>(bricks_.size());
  for (std::size_t i = 0; i < bricks_.size(); ++i) {
    const std::byte* const samples = slots_.find(bricks_[i]);
    if (samples && i >= first_load_) slots_.count_read(bricks_[i]);
    samples_.insert(key_of(bricks_[i], grid_)).first = samples;
  }
}

const std::byte* BatchBricks::find(Int3 brick) const {
  const auto* const found = samples_.find(key_of(brick, grid_));
  assert(found);
  return *found;
}

}  // namespace isobrick
