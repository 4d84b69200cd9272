#pragma once

#include <atomic>
#include <cstdint>
#include <vector>

#include <isobrick/store_reader.h>

namespace isobrick::inline v0 {

/// Some of a store's bricks, a bit for each; of levels that are stored, and bricks within their
/// lattices. One thread at a time changes it; others may call has() meanwhile, without waiting.
class BrickSet {
 public:
  explicit BrickSet(const StoreInfo& info) {
    for (const auto& level : info.levels) {
      const Int3 bricks = level.lattice.bricks();
      levels_.emplace_back(bricks, static_cast<std::size_t>((volume(bricks) + 63) / 64));
    }
  }

  bool has(int level, Int3 brick) const {
    const Place p = place_of(level, brick);
    return (levels_[p.level].words[p.word].load(std::memory_order_relaxed) & p.bit) != 0;
  }
  void insert(int level, Int3 brick) {
    const Place p = place_of(level, brick);
    levels_[p.level].words[p.word].fetch_or(p.bit, std::memory_order_relaxed);
  }
  void erase(int level, Int3 brick) {
    const Place p = place_of(level, brick);
    levels_[p.level].words[p.word].fetch_and(~p.bit, std::memory_order_relaxed);
  }

 private:
  struct Level {
    Level(Int3 b, std::size_t count) : bricks(b), words(count) {}
    Int3 bricks;
    std::vector<std::atomic<std::uint64_t>> words;
  };
  struct Place {
    std::size_t level, word;
    std::uint64_t bit;
  };

  Place place_of(int level, Int3 brick) const {
    const auto l = static_cast<std::size_t>(level);
    const auto i = static_cast<std::uint64_t>(linear_index(brick, levels_[l].bricks));
    return {l, static_cast<std::size_t>(i / 64), std::uint64_t{1} << i % 64};
  }

  std::vector<Level> levels_;
};

}  // namespace isobrick
