#pragma once

#include <cstddef>
#include <vector>

#include <isobrick/lattice.h>
#include "core/copy_box.h"

namespace isobrick::inline v0 {

/// A volume in memory, cut into bricks: for data that is small or already
/// there, for tests and for measuring. Bricks lie one after the other.
class DenseBricks final : public BrickLookup {
 public:
  /// Copies `samples`, C order [z, y, x] of `lattice.extent`. What a brick has
  /// beyond the volume's border is zero.
  DenseBricks(const Lattice& lattice, const void* samples)
      : lattice_(lattice),
        bytes_(static_cast<std::size_t>(volume(lattice.bricks())) * lattice.brick_bytes()) {
    const auto* from = static_cast<const std::byte*>(samples);
    for_each_point({{0, 0, 0}, lattice.bricks()}, [&](Int3 b) {
      copy_box({from, lattice.box()}, {at(b), lattice.full_brick_box(b)}, lattice.brick_box(b),
               lattice.sample_bytes());
    });
  }

  const Lattice& lattice() const { return lattice_; }
  const std::byte* find(Int3 b) const override { return bytes_.data() + offset(b); }

 private:
  std::size_t offset(Int3 b) const {
    return static_cast<std::size_t>(linear_index(b, lattice_.bricks())) * lattice_.brick_bytes();
  }
  std::byte* at(Int3 b) { return bytes_.data() + offset(b); }

  Lattice lattice_;
  std::vector<std::byte> bytes_;
};

}  // namespace isobrick
