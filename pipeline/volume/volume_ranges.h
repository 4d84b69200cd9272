#pragma once

#include <memory>
#include <optional>
#include <vector>

#include <isobrick/lattice.h>
#include <isobrick/range.h>
#include "core/tile.h"
#include "index/active_tiles.h"
#include "pipeline/volume/array_samples.h"

namespace isobrick::inline v0 {

/// The ranges of all blocks of 16³ cells of a volume: two samples for 4096.
class VolumeRanges {
 public:
  virtual ~VolumeRanges() = default;

  /// Finds the ranges of a box of blocks. `samples` has those that their cells touch. Thread-safe
  /// for boxes that do not overlap.
  virtual void scan(const ArraySamples& samples, Box3 blocks) = 0;
  /// Appends the tiles of a box with an active block, in Morton order within the box: a cube of
  /// tiles of a power of two, or the whole volume. With `cap` also those of capped surfaces.
  virtual void append_tiles(Box3 tiles, double isovalue, const std::optional<CapSearch>& cap,
                            std::vector<TileWork>& out) const = 0;
  /// Whether any sample was NaN so far.
  virtual bool has_nan() const = 0;
  /// Of all blocks that were scanned.
  virtual ValueRange<double> all() const = 0;
};

std::unique_ptr<VolumeRanges> make_volume_ranges(const Lattice& lattice);

/// Bytes that VolumeRanges::scan() takes on each thread for samples that are not read in place.
std::uint64_t range_scan_bytes(const Lattice& lattice);

/// Bytes of the ranges of a volume.
std::uint64_t volume_ranges_bytes(const Lattice& lattice);

}  // namespace isobrick
