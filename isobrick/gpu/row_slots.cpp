#include "isobrick/gpu/row_slots.h"

#include "isobrick/core/error.h"
#include "isobrick/core/morton.h"

namespace isobrick::gpu {

RowSlots::RowSlots(std::uint32_t slots, Int3 tiles) : last_tile_(tiles - Int3{1, 1, 1}) {
  free_.reserve(slots);
  for (std::uint32_t i = slots; i > 0; --i) free_.push_back(i - 1);
}

std::uint32_t RowSlots::add(Int3 tile) {
  if (free_.empty())
    throw Error(
        "the surface between finished and unfinished tiles does not fit the row tables on the "
        "device; use --backend cpu");
  const std::uint32_t slot = free_.back();
  free_.pop_back();
  const std::uint64_t key = morton_encode(tile);
  map_[key] = {slot, launch_};
  expiries_.push({morton_encode(min(tile + Int3{1, 1, 1}, last_tile_)), key});
  return slot;
}

std::uint32_t RowSlots::find(Int3 tile) const {
  const auto found = map_.find(morton_encode(tile));
  if (found == map_.end()) return kNone;
  return found->second.slot | (found->second.launch == launch_ ? TileLinks::kSameLaunch : 0);
}

void RowSlots::end_launch(Int3 last, std::vector<std::uint32_t>& unused) {
  ++launch_;
  const std::uint64_t now = morton_encode(last);
  while (!expiries_.empty() && expiries_.top().last_asker <= now) {
    const auto found = map_.find(expiries_.top().key);
    unused.push_back(found->second.slot);
    map_.erase(found);
    expiries_.pop();
  }
}

void RowSlots::recycle(std::vector<std::uint32_t>& slots) {
  free_.insert(free_.end(), slots.begin(), slots.end());
  slots.clear();
}

}  // namespace isobrick::gpu
