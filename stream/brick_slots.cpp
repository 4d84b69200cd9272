#include "stream/brick_slots.h"

#include <algorithm>
#include <iterator>
#include <utility>

#include "core/morton.h"

namespace isobrick::inline v0 {
namespace {

Int3 point_of(std::uint64_t key, Int3 grid) { return point_at(static_cast<Index>(key), grid); }

/// The tiles that look at samples of a brick: tile t does at 32·t − reach … 32·t + 32 + reach.
Box3 tiles_using(const Lattice& lattice, Index reach, Int3 brick) {
  Box3 tiles;
  for (int axis = 0; axis < 3; ++axis) {
    const Index first = brick[axis] * lattice.brick[axis], end = first + lattice.brick[axis];
    tiles.lo[axis] = ceil_div(std::max<Index>(first - kTileEdge - reach, 0), kTileEdge);
    tiles.hi[axis] = std::min((end - 1 + reach) / kTileEdge + 1, lattice.tiles()[axis]);
  }
  return tiles;
}

}  // namespace

std::uint64_t next_use(const Lattice& lattice, Index reach, Int3 brick, std::uint64_t code) {
  std::uint64_t next = kNever;
  for_each_point(tiles_using(lattice, reach, brick), [&](Int3 t) {
    const std::uint64_t of_tile = morton_encode(t);
    if (of_tile >= code) next = std::min(next, of_tile);
  });
  return next;
}

std::uint64_t last_use(const Lattice& lattice, Index reach, Int3 brick) {
  // The code grows with every coordinate.
  return morton_encode(tiles_using(lattice, reach, brick).hi - Int3{1, 1, 1});
}

void BrickSlots::add_slots(std::shared_ptr<std::byte> memory, std::size_t count) {
  // place() takes the slot that was freed last, and new slots in their order.
  const std::size_t bytes = lattice_.brick_bytes();
  std::vector<std::byte*> slots;
  for (std::size_t i = count; i > 0; --i) slots.push_back(memory.get() + (i - 1) * bytes);
  memory_.push_back(std::move(memory));
  free_.reserve(slots_ + count);
  free_.insert(free_.begin(), slots.begin(), slots.end());
  slots_ += count;
}

void BrickSlots::advance(std::uint64_t code) {
  now_ = code;
  while (!idle_.empty() && idle_.begin()->first < now_) {
    const std::uint64_t key = idle_.begin()->second;
    Entry& entry = entries_.at(key);
    entry.node = idle_.extract(idle_.begin());
    set_idle(key, entry);
  }
}

bool BrickSlots::hold(Int3 brick) {
  const auto found = entries_.find(key(brick));
  if (found == entries_.end()) return false;
  Entry& entry = found->second;
  if (entry.holds++ == 0) entry.node = idle_.extract({entry.next, found->first});
  return true;
}

std::byte* BrickSlots::place(Int3 brick) {
  while (free_.empty()) {
    if (idle_.empty()) return nullptr;
    drop(std::prev(idle_.end())->second);
  }
  std::byte* slot = free_.back();
  entries_.insert_or_assign(key(brick), Entry{slot, 1, kNever, new_node()});
  free_.pop_back();
  return slot;
}

void BrickSlots::set_absent(Int3 brick) {
  Entry& entry = entries_.at(key(brick));
  free_.push_back(entry.slot);
  entry.slot = nullptr;
}

void BrickSlots::count_read(Int3 brick) {
  ++reads_;
  bricks_read_.add(static_cast<std::size_t>(key(brick)));
}

BrickSlots::IdleSet::node_type BrickSlots::new_node() {
  IdleSet one;
  one.emplace();
  return one.extract(one.begin());
}

void BrickSlots::release(Int3 brick) noexcept {
  const auto found = entries_.find(key(brick));
  if (--found->second.holds == 0) set_idle(found->first, found->second);
}

void BrickSlots::set_idle(std::uint64_t key, Entry& entry) noexcept {
  entry.next = next_use(lattice_, reach_, point_of(key, lattice_.bricks()), now_);
  entry.node.value() = {entry.next, key};
  idle_.insert(std::move(entry.node));
  if (entry.next == kNever) drop(key);
}

void BrickSlots::drop(std::uint64_t key) noexcept {
  const auto found = entries_.find(key);
  idle_.erase({found->second.next, key});
  if (found->second.slot) free_.push_back(found->second.slot);
  entries_.erase(found);
}

}  // namespace isobrick
