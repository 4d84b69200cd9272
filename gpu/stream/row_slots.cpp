#include "gpu/stream/row_slots.h"

#include <algorithm>
#include <utility>

#include <isobrick/error.h>
#include "core/morton.h"
#include "surface/sample_vertices.h"

namespace isobrick::inline v0::gpu {
namespace {

/// Tiles of 8³ share their expiries: their codes differ in the last bits only.
std::uint64_t group_of(std::uint64_t code) { return code >> 9; }

/// Tiles of 4³ share a cube.
std::uint64_t key_of(Int3 tile) {
  return static_cast<std::uint64_t>(tile.x >> 2 | tile.y >> 2 << 21 | tile.z >> 2 << 42);
}
std::size_t place_of(Int3 tile) {
  return static_cast<std::size_t>((tile.x & 3) | (tile.y & 3) << 2 | (tile.z & 3) << 4);
}

}  // namespace

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
  if (const std::uint64_t key = key_of(tile); !added_cube_ || key != added_key_) {
    std::unique_ptr<Cube>& cube = cubes_.insert(key).first;
    if (!cube) cube = std::make_unique<Cube>();
    added_cube_ = cube.get();
    added_key_ = key;
  }
  added_cube_->entries[place_of(tile)] = {slot, launch_};
  ++added_cube_->used;
  const std::uint64_t last_user = morton_encode(min(tile + Int3{1, 1, 1}, last_tile_));
  if (added_last_ == expiries_.end() || added_last_->first != group_of(last_user))
    added_last_ = expiries_.try_emplace(group_of(last_user)).first;
  added_last_->second.push_back({last_user, morton_encode(tile)});
  return slot;
}

const RowSlots::Cube* RowSlots::cube_of(Int3 tile) const {
  const std::uint64_t key = key_of(tile);
  if (added_cube_ && key == added_key_) return added_cube_;
  const std::unique_ptr<Cube>* const cube = cubes_.find(key);
  return cube ? cube->get() : nullptr;
}

std::uint32_t RowSlots::find(Int3 tile) const {
  const Cube* const cube = cube_of(tile);
  if (!cube) return kNone;
  const Entry& entry = cube->entries[place_of(tile)];
  if (entry.slot == kNone) return kNone;
  return entry.slot | (entry.launch == launch_ ? TileLinks::kSameLaunch : 0);
}

void RowSlots::find_around(Int3 tile, TileNeighbours& around) const {
  for (std::size_t n = 0; n < std::size(around.slots); ++n) {
    const Int3 other = tile + offset_of(static_cast<std::uint8_t>(n));
    const bool exists = min(other, Int3{0, 0, 0}) == Int3{0, 0, 0};
    around.slots[n] = exists && other != tile ? find(other) : kNone;
  }
}

void RowSlots::end_launch(Int3 last, std::vector<std::uint32_t>& unused) {
  ++launch_;
  const std::uint64_t now = morton_encode(last);
  added_last_ = expiries_.end();
  while (!expiries_.empty() && expiries_.begin()->first < group_of(now)) {
    for (const Expiry& expiry : expiries_.begin()->second) drop(morton_decode(expiry.tile), unused);
    expiries_.erase(expiries_.begin());
  }
  if (expiries_.empty() || expiries_.begin()->first != group_of(now)) return;
  std::erase_if(expiries_.begin()->second, [&](const Expiry& expiry) {
    const bool over = expiry.last_user <= now;
    if (over) drop(morton_decode(expiry.tile), unused);
    return over;
  });
}

void RowSlots::drop(Int3 tile, std::vector<std::uint32_t>& unused) {
  const std::uint64_t key = key_of(tile);
  Cube& cube = **cubes_.find(key);
  unused.push_back(std::exchange(cube.entries[place_of(tile)], {}).slot);
  if (--cube.used > 0) return;
  if (&cube == added_cube_) added_cube_ = nullptr;
  cubes_.erase(key);
}

void RowSlots::recycle(std::vector<std::uint32_t>& slots) {
  free_.insert(free_.end(), slots.begin(), slots.end());
  slots.clear();
}

}  // namespace isobrick::gpu
