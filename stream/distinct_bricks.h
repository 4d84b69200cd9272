#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <isobrick/lattice.h>

namespace isobrick::inline v0 {

/// Counts the different bricks of a lattice among those that are added, with a bit for each.
class DistinctBricks {
 public:
  explicit DistinctBricks(const Lattice& lattice)
      : added_(static_cast<std::size_t>(volume(lattice.bricks()))) {}

  /// By its linear index in the lattice's bricks().
  void add(std::size_t brick) {
    auto is_added = added_[brick];
    count_ += !is_added;
    is_added = true;
  }
  std::uint64_t count() const { return count_; }
  /// Bricks of the lattice.
  std::uint64_t all() const { return added_.size(); }
  /// Memory that it takes.
  static std::uint64_t bytes(const Lattice& lattice) {
    return static_cast<std::uint64_t>(volume(lattice.bricks())) / 8;
  }

 private:
  std::vector<bool> added_;
  std::uint64_t count_ = 0;
};

}  // namespace isobrick
