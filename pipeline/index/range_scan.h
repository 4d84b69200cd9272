#pragma once

#include <cstddef>
#include <deque>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include <isobrick/lattice.h>
#include <isobrick/range.h>

namespace isobrick::inline v0 {

/// Takes a finished layer of ranges: the items it covers and their pairs
/// (lo, hi) of the sample type, C order [z, y, x, 2].
using RangeEmit = std::function<void(Box3 items, std::span<const std::byte> pairs)>;

/// Ranges of all items of a lattice, each a box of `edge` cells, fed with boxes
/// of samples. An item's range covers its own samples and the first layer of its
/// +x, +y and +z neighbours: all that its cells touch.
///
/// Boxes may come in any order as long as no sample lies below the last
/// `close`; only the layers of items still open are held in memory.
///
/// A scanner of a part of the samples has the items that these touch. Its ranges of items that
/// others touch too are merged by a scanner of all samples.
template <class T>
class RangeScanner {
 public:
  /// `part` of the samples, not empty.
  RangeScanner(Box3 part, Int3 edge);

  /// Merges the samples of `box`, dense in C order. Parallel inside.
  void add(Box3 box, const T* samples);
  /// Merges ranges of `items`, which are of one layer, C order. Throws Error where these are none
  /// of the scanner's, or of a layer that is closed.
  void merge(Box3 items, std::span<const ValueRange<T>> ranges);

  /// Promises that every sample of the part below z1 was added. Emits the layers of items
  /// that this completes, in order of z.
  void close(Index z1, const RangeEmit& emit);

  /// Whether any sample so far was NaN.
  bool has_nan() const { return has_nan_; }

 private:
  using Layer = std::vector<ValueRange<T>>;

  Layer& layer(Index z);

  Int3 edge_;
  Index end_;   ///< z behind the last sample
  Box3 items_;  ///< of which there are ranges
  Index first_open_;
  std::deque<Layer> open_;
  bool has_nan_ = false;
};

/// Both kinds of range that a store keeps for a level, whatever its type.
class LevelRanges {
 public:
  virtual ~LevelRanges() = default;
  virtual void add(Box3 box, const std::byte* samples) = 0;
  virtual void close(Index z1, const RangeEmit& blocks, const RangeEmit& bricks) = 0;
  virtual bool has_nan() const = 0;
  /// Merge what the ranges of a part emitted.
  virtual void merge_blocks(Box3 items, std::span<const std::byte> pairs) = 0;
  virtual void merge_bricks(Box3 items, std::span<const std::byte> pairs) = 0;
};

std::unique_ptr<LevelRanges> make_level_ranges(const Lattice& lattice);
/// Those of a part of a level's samples, a box of whole bricks. Emits ranges of bricks only where
/// they do not follow from those of all blocks.
std::unique_ptr<LevelRanges> make_part_ranges(const Lattice& lattice, Box3 part);

/// Bytes that the LevelRanges of a level hold while slabs of `planes` pass.
std::size_t level_ranges_bytes(const Lattice& lattice, Index planes);
/// Bytes of the layer of chunks that a writer of ranges gathers of a level.
std::size_t gathered_ranges_bytes(const Lattice& lattice);

}  // namespace isobrick
