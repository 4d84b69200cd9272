#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <span>

#include <isobrick/progress.h>
#include <isobrick/selection.h>
#include <isobrick/store_reader.h>
#include "bricks/ranges/item_array.h"
#include "bricks/ranges/stored_ranges.h"
#include "io/bytes/file.h"
#include "pipeline/index/value_counts.h"

namespace isobrick::inline v0 {

/// Computes the ranges of all levels and adds them to the store, which must be
/// opened anew to find them; what it had stays until all new ones are there.
/// Runs in the current arena; throws UsageError when `memory` is too small for a
/// brick, naming the least that does.
void add_ranges(const StoreReader& store, std::uint64_t memory, int threads, Progress& progress);

/// Bytes for the samples of a piece of a level that is read for its ranges: what the budget leaves.
/// `others` go for what decoding takes beyond bricks, and are not in `memory`. Throws UsageError as
/// add_ranges() does.
std::uint64_t range_piece_bytes(const LevelInfo& level, std::uint64_t memory, std::uint64_t others,
                                int threads);

/// Takes the ranges of a level, and the checksums of its bricks, and writes them beside their
/// places. Each item is put once. Thread-safe.
class LevelRangeOutput {
 public:
  LevelRangeOutput(const StoreReader& store, int level, Publisher& publisher);

  /// Pairs as RangeEmit.
  void put_blocks(Box3 items, std::span<const std::byte> pairs) { put(blocks_, items, pairs); }
  void put_bricks(Box3 items, std::span<const std::byte> pairs) { put(bricks_, items, pairs); }
  void put_checksums(Box3 bricks, std::span<const std::uint32_t> checksums) {
    checksums_.put(bricks, std::as_bytes(checksums));
  }
  RangeChecksums finish();

 private:
  LevelRangeOutput(const Lattice& lattice, const std::filesystem::path& root, int level,
                   Publisher& publisher);
  void put(ItemArrayWriter& to, Box3 items, std::span<const std::byte> pairs);

  ScalarType type_;
  ItemArrayWriter blocks_, bricks_, checksums_;
};

/// Puts all ranges of a level; returns whether any of its samples is NaN.
using FillRanges = std::function<bool(int level, LevelRangeOutput& output)>;

/// Gives a store the ranges that `fill` puts for each level in turn, and the histogram that
/// `counts` has then. What the store had stays until all new ones are there.
void replace_ranges(const StoreReader& store, const FillRanges& fill, ValueCounts& counts);

/// Throws UsageError where nothing can be added to a store, because it is a zip.
void check_can_add(const std::filesystem::path& store);

/// Keeps others from adding to the same store at the same time, while it is held. Throws Error when
/// another process does.
UniqueFd lock_store(const std::filesystem::path& store);

/// Whether every level has ranges.
bool has_all_ranges(const StoreReader& store);

/// Adds the ranges that a volume lacks, in an arena of its own of so many threads (0: all cores).
/// Leaves nothing of them when it fails or is cancelled. Throws what lock_store() and add_ranges()
/// do.
void add_missing_ranges(const std::filesystem::path& store, const Selection& volume,
                        std::uint64_t memory, int threads, Progress& progress);

}  // namespace isobrick
