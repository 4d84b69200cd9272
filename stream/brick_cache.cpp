#include "stream/brick_cache.h"

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "stream/brick_memory.h"

namespace isobrick::inline v0 {
namespace {

/// Memory grows by some large pages.
constexpr std::size_t kGrowth = std::size_t{32} << 20;

}  // namespace

CachedBricks::CachedBricks(BrickSlots& slots, std::span<const Int3> bricks, Int3 last)
    : bricks_(slots, bricks, last) {}

CachedBricks::~CachedBricks() noexcept {
  tasks_.cancel();
  try {
    tasks_.wait();
  } catch (...) {
    // Nothing reads these bricks any more.
  }
}

void CachedBricks::wait() {
  tasks_.wait();
  for (const Load& load : loads_)
    if (!load.present) bricks_.set_absent(load.brick);
  loads_.clear();
  bricks_.set_decoded();
}

BrickCache::BrickCache(const StoreReader& store, int level, Index reach, std::size_t capacity)
    : reader_(store, level), capacity_(capacity), slots_(reader_.lattice(), reach) {}

std::unique_ptr<CachedBricks> BrickCache::begin(std::span<const Int3> bricks, Int3 last) {
  auto begun = std::make_unique<CachedBricks>(slots_, bricks, last);
  begun->loads_.reserve(begun->bricks_.loads());
  while (begun->bricks_.missing() > 0) {
    if (slots_.free_slots() == 0 && slots_.slots() < capacity_) grow();
    const BrickLoad load = begun->bricks_.place();
    if (!load.slot) throw std::logic_error("more bricks are in use than there is room for");
    begun->loads_.push_back({load});
  }
  for (CachedBricks::Load& load : begun->loads_)
    begun->tasks_.run([this, &load] { load.present = reader_.read(load.brick, load.slot); });
  return begun;
}

void BrickCache::grow() {
  const std::size_t brick = reader_.lattice().brick_bytes();
  const std::size_t count = std::clamp<std::size_t>(kGrowth / brick, 1, capacity_ - slots_.slots());
  slots_.add_slots(allocate_bricks(count * brick), count);
}

void BrickCache::will_need(CachedBricks& begun, std::vector<Int3> bricks) {
  if (!reader_.reads_disk()) return;
  std::erase_if(bricks, [&](Int3 b) { return slots_.contains(b); });
  begun.tasks_.run([this, bricks = std::move(bricks)] { reader_.will_need(bricks); });
}

}  // namespace isobrick
