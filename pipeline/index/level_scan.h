#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>

#include "pipeline/index/range_scan.h"
#include "pipeline/index/value_counts.h"
#include "pipeline/slab_reader.h"

namespace isobrick::inline v0 {

/// Reads all samples of a level, in pieces of at most `piece_bytes` (or of one
/// brick), and feeds them to `ranges`, whose finished layers go to `blocks` and
/// `bricks`. Without `failure` the first brick that cannot be read ends it.
/// `advance` receives each piece's bytes; `checksum`, if there is one, receives that of each brick
/// (see read_slab). `counts`, if there are any, see every sample.
void scan_level(const StoreReader& store, int level, std::size_t piece_bytes, LevelRanges& ranges,
                const BrickFailure& failure, const RangeEmit& blocks, const RangeEmit& bricks,
                const std::function<void(std::uint64_t)>& advance,
                const BrickChecksum& checksum = nullptr, ValueCounts* counts = nullptr);

}  // namespace isobrick
