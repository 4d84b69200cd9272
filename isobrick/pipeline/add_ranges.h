#pragma once

#include <cstdint>

#include "isobrick/bricks/store_reader.h"
#include "isobrick/core/progress.h"

namespace isobrick {

/// Computes the ranges of all levels and adds them to the store, which must be
/// opened anew to find them; what it had stays until all new ones are there.
/// Runs in the current arena; throws UsageError when `memory` is too small for a
/// brick, naming the least that does.
void add_ranges(const StoreReader& store, std::uint64_t memory, int threads, Progress& progress);

}  // namespace isobrick
