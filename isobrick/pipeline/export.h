#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>

#include "isobrick/bricks/store_reader.h"
#include "isobrick/core/progress.h"

namespace isobrick {

/// Writes the samples of one level (or of `roi`, in samples of that level) as a
/// raw file, C order [z, y, x], little endian. Memory: one row of bricks at a
/// time, within `memory`. Nothing appears under the final name until it is whole.
/// Returns the bytes written.
std::uint64_t export_raw(const StoreReader& store, int level, std::optional<Box3> roi,
                         const std::filesystem::path& out, bool force, std::uint64_t memory,
                         int threads, Progress& progress);

}  // namespace isobrick
