#pragma once

#include <cstddef>

#include <isobrick/lattice.h>
#include <isobrick/sample_value.h>
#include "core/tile.h"

namespace isobrick::inline v0 {

/// Where the samples of a tile go: a place for its sample (0, 0, 0), and how far its rows
/// and planes are apart, all counted in samples.
struct TileBlock {
  std::byte* samples;
  Index origin, row, plane;
};

/// The samples of a volume, as tiles take them. Thread-safe.
class TileSamples {
 public:
  virtual ~TileSamples() = default;
  /// Copies the samples that the tile's active blocks need, and `reach` layers around them, cut at
  /// the volume's border.
  virtual void gather(const TileWork& work, Index reach, const TileBlock& block) const = 0;
};

/// The samples of a volume in bricks, of which those that tiles need are there.
class BrickSamples final : public TileSamples {
 public:
  /// The lattice and the bricks must outlive it. Absent bricks hold `fill`.
  BrickSamples(const Lattice& lattice, const BrickLookup& bricks, const SampleValue& fill)
      : lattice_(lattice), bricks_(bricks), fill_(fill) {}
  void gather(const TileWork& work, Index reach, const TileBlock& block) const override;

 private:
  const Lattice& lattice_;
  const BrickLookup& bricks_;
  SampleValue fill_;
};

}  // namespace isobrick
