#include "pipeline/sample/brick_lru.h"

#include <tbb/parallel_for.h>

#include <utility>

namespace isobrick::inline v0 {

BrickLru::BrickLru(const StoreReader& store, std::size_t capacity)
    : store_(store), capacity_(capacity) {}

/// Memory for a brick beside `taken` others: that of the brick that was used longest ago, where no
/// more may be allocated.
std::vector<std::byte> BrickLru::take_memory(std::size_t taken) {
  if (entries_.size() + taken < capacity_) return {};
  const auto oldest = entries_.find(order_.back());
  std::vector<std::byte> memory = std::move(oldest->second.samples);
  entries_.erase(oldest);
  order_.pop_back();
  return memory;
}

void BrickLru::hold(std::span<const std::uint64_t> bricks, std::vector<const std::byte*>& found) {
  const Lattice& lattice = store_.info().levels.front().lattice;
  std::vector<std::pair<std::uint64_t, std::vector<std::byte>>> missing;
  for (const std::uint64_t brick : bricks) {
    if (const auto entry = entries_.find(brick); entry != entries_.end())
      order_.splice(order_.begin(), order_, entry->second.order);
    else
      missing.emplace_back(brick, std::vector<std::byte>());
  }
  // Those that are held now were moved to the front, so none of them is dropped.
  for (std::size_t i = 0; i < missing.size(); ++i) missing[i].second = take_memory(i);
  const Int3 grid = lattice.bricks();
  tbb::parallel_for(std::size_t{0}, missing.size(), [&](std::size_t i) {
    auto& [number, samples] = missing[i];
    samples.resize(lattice.brick_bytes());
    if (!store_.read_brick(0, point_at(static_cast<Index>(number), grid), samples.data()))
      samples = {};
  });
  for (auto& [brick, samples] : missing) {
    order_.push_front(brick);
    entries_[brick] = {std::move(samples), order_.begin()};
  }
  reads_ += missing.size();
  found.clear();
  for (const std::uint64_t brick : bricks) {
    const std::vector<std::byte>& samples = entries_.at(brick).samples;
    found.push_back(samples.empty() ? nullptr : samples.data());
  }
}

}  // namespace isobrick
