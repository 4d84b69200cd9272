#include "isobrick/gpu/row_slots.h"

#include <algorithm>

#include "isobrick/core/error.h"
#include "isobrick/core/morton.h"

namespace isobrick::gpu {
namespace {

/// Tiles of 8³ lie in one cube: their codes differ in the last bits only.
std::uint64_t cube_of(std::uint64_t code) { return code >> 9; }

}  // namespace

RowSlots::RowSlots(std::uint32_t slots, Int3 tiles)
    : map_(slots), last_tile_(tiles - Int3{1, 1, 1}) {
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
  map_.insert(key).first = {slot, launch_};
  const std::uint64_t last_asker = morton_encode(min(tile + Int3{1, 1, 1}, last_tile_));
  if (added_last_ == expiries_.end() || added_last_->first != cube_of(last_asker))
    added_last_ = expiries_.try_emplace(cube_of(last_asker)).first;
  added_last_->second.push_back({last_asker, key});
  return slot;
}

std::uint32_t RowSlots::find(Int3 tile) const {
  const Entry* found = map_.find(morton_encode(tile));
  if (!found) return kNone;
  return found->slot | (found->launch == launch_ ? TileLinks::kSameLaunch : 0);
}

void RowSlots::end_launch(Int3 last, std::vector<std::uint32_t>& unused) {
  ++launch_;
  const std::uint64_t now = morton_encode(last);
  added_last_ = expiries_.end();
  while (!expiries_.empty() && expiries_.begin()->first < cube_of(now)) {
    for (const Expiry& expiry : expiries_.begin()->second) drop(expiry, unused);
    expiries_.erase(expiries_.begin());
  }
  if (expiries_.empty() || expiries_.begin()->first != cube_of(now)) return;
  std::erase_if(expiries_.begin()->second, [&](const Expiry& expiry) {
    const bool over = expiry.last_asker <= now;
    if (over) drop(expiry, unused);
    return over;
  });
}

void RowSlots::drop(const Expiry& expiry, std::vector<std::uint32_t>& unused) {
  unused.push_back(map_.find(expiry.key)->slot);
  map_.erase(expiry.key);
}

void RowSlots::recycle(std::vector<std::uint32_t>& slots) {
  free_.insert(free_.end(), slots.begin(), slots.end());
  slots.clear();
}

}  // namespace isobrick::gpu
