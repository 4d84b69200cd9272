#pragma once

#include <functional>
#include <string>

#include "isobrick/bricks/store_reader.h"
#include "isobrick/bricks/stored_index.h"
#include "isobrick/core/progress.h"

namespace isobrick {

/// Reads all of one index: every part's checksum and structure, and whether it is
/// what the store's ranges and samples make. `damage` is told a line for each that
/// is wrong; called from one thread at a time. Parallel in the caller's arena.
/// Returns the bytes read.
std::uint64_t verify_index(const StoreReader& store, int level, const std::string& kind,
                           int threads, const std::function<void(const std::string&)>& damage,
                           Progress& progress);

}  // namespace isobrick
