#pragma once

#include <cstddef>
#include <cstdint>
#include <list>
#include <span>
#include <unordered_map>
#include <vector>

#include <isobrick/store_reader.h>

namespace isobrick::inline v0 {

/// Decoded bricks of level 0 for points in any order; the least recently used is dropped first.
/// (BrickCache is for tiles in Morton order.) For one thread, which decodes with the other threads
/// of its arena.
class BrickLru {
 public:
  /// Holds `capacity` bricks at most. `store` must outlive it.
  BrickLru(const StoreReader& store, std::size_t capacity);

  /// Reads those of `bricks` (numbers in the lattice's grid, distinct, at most as many as the
  /// capacity) that are missing, and sets `found` to the samples of each, null of an absent one.
  /// They are valid until the next call.
  void hold(std::span<const std::uint64_t> bricks, std::vector<const std::byte*>& found);

  std::size_t capacity() const { return capacity_; }
  std::uint64_t reads() const { return reads_; }

 private:
  struct Entry {
    std::vector<std::byte> samples;  ///< empty where the brick is absent
    std::list<std::uint64_t>::iterator order;
  };
  std::vector<std::byte> take_memory(std::size_t taken);

  const StoreReader& store_;
  const std::size_t capacity_;
  std::unordered_map<std::uint64_t, Entry> entries_;
  std::list<std::uint64_t> order_;  ///< most recently used first
  std::uint64_t reads_ = 0;
};

}  // namespace isobrick
