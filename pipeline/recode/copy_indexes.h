#pragma once

#include <cstdint>
#include <filesystem>

#include <isobrick/progress.h>
#include <isobrick/store_reader.h>

namespace isobrick::inline v0 {

/// Copies the indices of a store to one in `folder` that has the same ranges. Every part of them
/// is checked: throws DamageError naming the file that is damaged. Returns their bytes.
std::uint64_t copy_indexes(const StoreReader& store, const std::filesystem::path& folder,
                           Progress& progress);

}  // namespace isobrick
