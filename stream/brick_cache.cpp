#include "stream/brick_cache.h"

#include <sys/mman.h>

#include <algorithm>
#include <cassert>
#include <new>
#include <stdexcept>
#include <utility>

#include "core/morton.h"

namespace isobrick {

CachedBricks::~CachedBricks() noexcept {
  tasks_.cancel();
  try {
    tasks_.wait();
  } catch (...) {
    // Nobody waits for these bricks any more.
  }
  for (const Int3 b : bricks_) cache_.slots_.release(b);
}

void CachedBricks::wait() {
  tasks_.wait();
  for (const Load& load : loads_)
    if (load.present)
      cache_.slots_.count_read(load.brick);
    else
      cache_.slots_.set_absent(load.brick);
  loads_.clear();
  for (const Int3 b : bricks_) samples_[cache_.key(b)] = cache_.slots_.find(b);
}

const std::byte* CachedBricks::find(Int3 brick) const {
  const auto found = samples_.find(cache_.key(brick));
  assert(found != samples_.end());
  return found->second;
}

BrickCache::BrickCache(const StoreReader& store, int level, Index reach, std::size_t capacity)
    : store_(store),
      level_(level),
      lattice_(store.info().levels[static_cast<std::size_t>(level)].lattice),
      capacity_(capacity),
      check_(store, level),
      slots_(lattice_, reach) {}

std::unique_ptr<CachedBricks> BrickCache::begin(std::span<const Int3> bricks, Int3 last) {
  auto begun = std::make_unique<CachedBricks>(*this);
  begun->bricks_.reserve(bricks.size());
  std::vector<Int3> missing;
  // First what is here: it must not go as needed by nobody later, nor for what is missing.
  for (const Int3 b : bricks) (slots_.hold(b) ? begun->bricks_ : missing).push_back(b);
  slots_.advance(morton_encode(last) + 1);
  for (const Int3 b : missing) {
    begun->loads_.push_back({b, place(b)});
    begun->bricks_.push_back(b);
  }
  for (CachedBricks::Load& load : begun->loads_)
    begun->tasks_.run([this, &load] {
      load.present = store_.read_brick(level_, load.brick, load.samples);
      check_.check(load.brick, load.present ? load.samples : nullptr);
    });
  return begun;
}

std::byte* BrickCache::place(Int3 brick) {
  if (slots_.free_slots() == 0 && places_ < capacity_) grow();
  std::byte* const samples = slots_.place(brick);
  if (!samples) throw std::logic_error("more bricks are in use than there is room for");
  return samples;
}

/// Memory comes in large pages, for the first touch of a small one costs as much as the
/// decoding of what it holds.
void BrickCache::grow() {
  constexpr std::size_t page = std::size_t{2} << 20, good = 16 * page;
  const std::size_t brick = lattice_.brick_bytes();
  const std::size_t count = std::clamp<std::size_t>(good / brick, 1, capacity_ - places_);
  const std::size_t bytes = count * brick;
  const bool large = bytes >= page;
  const std::size_t align = large ? page : 64;
  auto* slab =
      static_cast<std::byte*>(std::aligned_alloc(align, (bytes + align - 1) / align * align));
  if (!slab) throw std::bad_alloc();
  slabs_.emplace_back(slab);
  if (large) (void)madvise(slab, bytes, MADV_HUGEPAGE);
  slots_.add_slots(slab, count);
  places_ += count;
}

void BrickCache::will_need(CachedBricks& begun, std::vector<Int3> bricks) {
  if (store_.brick_times().from_memory()) return;
  std::erase_if(bricks, [&](Int3 b) { return slots_.contains(b); });
  begun.tasks_.run([this, bricks = std::move(bricks)] {
    for (const Int3 b : bricks) store_.will_need(level_, b);
  });
}

}  // namespace isobrick
