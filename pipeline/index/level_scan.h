#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

#include "pipeline/index/range_scan.h"
#include "pipeline/index/value_counts.h"
#include "pipeline/slab_reader.h"

namespace isobrick::inline v0 {

/// What a scan feeds beside ranges.
struct ScanOutputs {
  BrickFailure failure = nullptr;    ///< without it the first brick that cannot be read ends all
  BrickChecksum checksum = nullptr;  ///< receives that of each brick (see read_slab)
  ValueCounts* counts = nullptr;     ///< see every sample
  std::function<void(std::uint64_t)> advance;  ///< receives each piece's bytes
};

/// Reads the samples of `box`, whole bricks of one layer, in pieces of at most `piece_bytes` (or of
/// one brick), and feeds them to `ranges`. `buffer` keeps its room from call to call; what a
/// damaged brick leaves is never uninitialised.
void scan_box(const StoreReader& store, int level, Box3 box, std::size_t piece_bytes,
              std::vector<std::byte>& buffer, LevelRanges& ranges, const ScanOutputs& outputs);

/// Reads all samples of a level in such pieces; finished layers of ranges go to `blocks` and
/// `bricks`.
void scan_level(const StoreReader& store, int level, std::size_t piece_bytes, LevelRanges& ranges,
                const RangeEmit& blocks, const RangeEmit& bricks, const ScanOutputs& outputs);

}  // namespace isobrick
