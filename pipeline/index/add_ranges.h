#pragma once

#include <cstdint>
#include <filesystem>

#include <isobrick/progress.h>
#include <isobrick/selection.h>
#include <isobrick/store_reader.h>
#include "io/bytes/file.h"

namespace isobrick::inline v0 {

/// Computes the ranges of all levels and adds them to the store, which must be
/// opened anew to find them; what it had stays until all new ones are there.
/// Runs in the current arena; throws UsageError when `memory` is too small for a
/// brick, naming the least that does.
void add_ranges(const StoreReader& store, std::uint64_t memory, int threads, Progress& progress);

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
