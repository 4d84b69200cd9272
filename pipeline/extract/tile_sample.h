#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/tile.h"

namespace isobrick::inline v0 {

/// Active tiles of one cube of 2×2×2: they follow each other in Morton order,
/// and with bricks of 64³ samples they lie in one.
struct TileGroup {
  std::uint64_t cube = 0;  ///< Morton code
  int count = 0;
  TileWork tiles[8];
};

/// Chooses some groups from a sequence of tiles in Morton order whose length is
/// not known before. The sequence of groups is cut into strata of equal length
/// and one is taken from each, the one whose hash is least: so the choice is
/// even in space, is no grid that structures of the volume could fall in step
/// with, and is the same every time.
class TileSample {
 public:
  /// `most` is even. Between half as many and `most` groups are chosen; all when
  /// there are no more.
  explicit TileSample(std::size_t most) : most_(most) {}

  void add(const TileWork& work);

  /// One group a stratum, in Morton order.
  std::vector<TileGroup> chosen() const;

 private:
  void take_pending();

  std::size_t most_;
  TileGroup pending_;                     ///< not yet among the seen ones
  std::uint64_t seen_ = 0, stratum_ = 1;  ///< groups so far, groups a stratum
  std::vector<TileGroup> chosen_;
};

}  // namespace isobrick
