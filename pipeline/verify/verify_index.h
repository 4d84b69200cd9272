#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include <isobrick/progress.h>
#include <isobrick/store_reader.h>
#include "bricks/stored_index.h"

namespace isobrick::inline v0 {

/// Reads all of one index: every part's checksum and structure, and whether it is
/// what the store's ranges and samples make. `damage` gets a line for each part that
/// is wrong; called from one thread at a time. Within `memory` bytes, with fewer threads where they
/// take too much of it; UsageError when that is too little. Returns the bytes read.
std::uint64_t verify_index(const StoreReader& store, int level, const std::string& kind,
                           int threads, std::uint64_t memory,
                           const std::function<void(const std::string&)>& damage,
                           Progress& progress);

}  // namespace isobrick
