#pragma once

#include <cstddef>
#include <cstring>
#include <vector>

#include "isobrick/core/lattice.h"

namespace isobrick {

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
    const std::size_t size = lattice.sample_bytes();
    for_each_point({{0, 0, 0}, lattice.bricks()}, [&](Int3 b) {
      const Box3 box = lattice.brick_box(b);
      std::byte* brick = at(b);
      for (Index z = box.lo.z; z < box.hi.z; ++z)
        for (Index y = box.lo.y; y < box.hi.y; ++y) {
          const Int3 row = Int3{box.lo.x, y, z} - b * lattice.brick;
          std::memcpy(
              brick + static_cast<std::size_t>(linear_index(row, lattice.brick)) * size,
              from +
                  static_cast<std::size_t>(linear_index({box.lo.x, y, z}, lattice.extent)) * size,
              static_cast<std::size_t>(box.extent().x) * size);
        }
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
