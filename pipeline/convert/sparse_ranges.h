#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include <isobrick/lattice.h>
#include "bricks/store_writer.h"

namespace isobrick::inline v0 {

/// The ranges of what one brick's samples touch: its own blocks and, below it
/// along each axis, those of its neighbours that see its first samples.
struct BrickBlocks {
  Box3 blocks;                   ///< in blocks of the level
  std::vector<std::byte> pairs;  ///< (lo, hi) of the level's type, C order [z, y, x, 2]
  bool has_nan = false;
};

/// Scans the samples of a brick's `box`, dense in C order. Thread-safe.
BrickBlocks scan_brick(const Lattice& lattice, Box3 box, const std::byte* samples);

/// The same of a brick all of whose samples are `bits` (see VolumeSource::constant).
BrickBlocks constant_brick(const Lattice& lattice, Box3 box, std::uint64_t bits);

/// Ranges of a level of which few bricks are there; all others are the fill
/// value. Memory: chunks of ranges that some brick touches, a layer or two.
class SparseRanges {
 public:
  virtual ~SparseRanges() = default;

  /// What a brick that is there has. From one thread, with increasing z of boxes.
  virtual void add(const BrickBlocks& brick) = 0;
  /// All bricks that begin below z1 were added: writes the ranges, of bricks
  /// and of blocks, that this completes.
  virtual void close(Index z1) = 0;
};

/// Whether a brick of the level is among those that are added.
using BrickTest = std::function<bool(Int3 brick)>;

/// Whether the lattice's bricks fit the chunks of ranges, without which there
/// are no sparse ranges.
bool sparse_ranges_possible(const Lattice& lattice);

/// Bytes that sparse ranges, and the checksums of bricks, take while `bricks` are added by
/// `threads` threads, and the store's writer for them.
std::size_t sparse_ranges_bytes(const LevelInfo& level, std::span<const Int3> bricks, int threads);

/// `store` outlives the ranges.
std::unique_ptr<SparseRanges> make_sparse_ranges(StoreWriter& store, int level,
                                                 const Lattice& lattice,
                                                 const SampleValue& fill_value, BrickTest is_there);

}  // namespace isobrick
