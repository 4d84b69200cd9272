#pragma once

#include <cstddef>
#include <span>
#include <tuple>
#include <vector>

#include <isobrick/lattice.h>
#include <isobrick/volume_source.h>

namespace isobrick::inline v0 {

/// A brick that may be something else than the fill value.
struct SparseBrick {
  Int3 brick;
  std::size_t place = 0;  ///< of its samples in a spool
};

/// Such bricks of one level, in families: those that are downsampled into one brick of the next
/// level stand together. Families are in the order z, y, x of their parents.
class SparseBricks {
 public:
  SparseBricks() = default;
  /// `factors`: from this level to the next one.
  SparseBricks(std::vector<SparseBrick> bricks, Int3 factors);

  /// The brick of the next level that a brick is downsampled into.
  Int3 parent_of(Int3 brick) const { return floor_div(brick, factors_); }

  std::span<const SparseBrick> all() const { return bricks_; }
  std::size_t families() const;
  /// The family whose first brick is number `first` of all; empty at the end.
  std::span<const SparseBrick> family_at(std::size_t first) const;
  bool contains(Int3 brick) const;

 private:
  auto order_of(Int3 brick) const {
    const Int3 p = parent_of(brick);
    return std::tuple(p.z, p.y, p.x, brick.z, brick.y, brick.x);
  }

  std::vector<SparseBrick> bricks_;
  Int3 factors_{2, 2, 2};
};

/// How many bricks of `source` are not known to be the fill value.
std::size_t count_sparse_bricks(const VolumeSource& source, const Lattice& lattice);
/// Those bricks, `count` of them.
std::vector<SparseBrick> find_sparse_bricks(const VolumeSource& source, const Lattice& lattice,
                                            std::size_t count);

}  // namespace isobrick
