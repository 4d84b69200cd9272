#include "isobrick/stream/brick_cache.h"

#include <sys/mman.h>
#include <tbb/parallel_for_each.h>

#include <algorithm>
#include <cassert>
#include <new>

#include "isobrick/stream/brick_slots.h"

namespace isobrick {

BrickCache::BrickCache(const StoreReader& store, int level, Index reach, std::size_t capacity)
    : store_(store),
      level_(level),
      reach_(reach),
      lattice_(store.info().levels[static_cast<std::size_t>(level)].lattice),
      capacity_(capacity) {}

std::uint64_t BrickCache::key(Int3 brick) const {
  return static_cast<std::uint64_t>(linear_index(brick, lattice_.bricks()));
}

BrickCache::Samples BrickCache::take_buffer() {
  if (!spare_.empty()) {
    Samples buffer = spare_.back();
    spare_.pop_back();
    return buffer;
  }
  if (buffers_ < capacity_) return new_buffer();
  // What is required now was moved to the front, so the back is free to go.
  for (;;) {
    const Entry gone = order_.back();
    entries_.erase(gone.key);
    order_.pop_back();
    if (!gone.samples) continue;
    cut_.emplace(gone.key, gone.last_use);
    return gone.samples;
  }
}

/// Memory comes in large pages, for the first touch of a small one costs as much as the
/// decoding of what it holds.
BrickCache::Samples BrickCache::new_buffer() {
  constexpr std::size_t page = std::size_t{2} << 20, good = 16 * page;
  const std::size_t brick = lattice_.brick_bytes();
  if (slab_buffers_ == 0) {
    slab_buffers_ = std::clamp<std::size_t>(good / brick, 1, capacity_ - buffers_);
    const std::size_t bytes = slab_buffers_ * brick;
    const bool large = bytes >= page;
    const std::size_t align = large ? page : 64;
    auto* slab =
        static_cast<std::byte*>(std::aligned_alloc(align, (bytes + align - 1) / align * align));
    if (!slab) throw std::bad_alloc();
    slabs_.emplace_back(slab);
    if (large) (void)madvise(slab, bytes, MADV_HUGEPAGE);
  }
  ++buffers_;
  return slabs_.back().get() + --slab_buffers_ * brick;
}

void BrickCache::require(std::span<const Int3> bricks) {
  assert(bricks.size() <= capacity_);
  std::vector<Int3> missing;
  for (const Int3 b : bricks) {
    const auto found = entries_.find(key(b));
    if (found == entries_.end())
      missing.push_back(b);
    else
      order_.splice(order_.begin(), order_, found->second);
  }
  struct Load {
    Int3 brick;
    Samples samples = nullptr;
    bool present = false;
  };
  std::vector<Load> loads;
  for (const Int3 b : missing) loads.push_back({b, take_buffer()});
  tbb::parallel_for_each(loads, [&](Load& load) {
    load.present = store_.read_brick(level_, load.brick, load.samples);
  });
  for (Load& load : loads) {
    if (!load.present) spare_.push_back(load.samples);
    if (load.present) {
      ++reads_;
      bricks_read_ += cut_.erase(key(load.brick)) == 0;
    }
    order_.push_front({key(load.brick), load.present ? load.samples : nullptr,
                       last_use(lattice_, reach_, load.brick)});
    entries_[key(load.brick)] = order_.begin();
  }
}

void BrickCache::drop_before(std::uint64_t code) {
  for (auto at = order_.begin(); at != order_.end();) {
    const auto entry = at++;
    if (entry->last_use >= code) continue;
    if (entry->samples) spare_.push_back(entry->samples);
    entries_.erase(entry->key);
    order_.erase(entry);
  }
  std::erase_if(cut_, [&](const auto& cut) { return cut.second < code; });
}

void BrickCache::will_need(std::span<const Int3> bricks) const {
  // A hint is a call of the system: in sum they would hold a fast disk up.
  tbb::parallel_for_each(bricks.begin(), bricks.end(), [&](Int3 b) {
    if (!entries_.count(key(b))) store_.will_need(level_, b);
  });
}

const std::byte* BrickCache::find(Int3 brick) const {
  const auto found = entries_.find(key(brick));
  assert(found != entries_.end());
  return found->second->samples;
}

}  // namespace isobrick
