#pragma once

#include <filesystem>

#include <isobrick/convert.h>
#include "bricks/store_layout.h"

namespace isobrick::inline v0 {

/// Throws UsageError where the store that the parts are for is there already and must stay.
void check_part_output(const std::filesystem::path& out, const ConvertOptions& options);

/// Writes a part of a store: its shards of level 0, and what the rest is made of. See
/// ConvertOptions::part.
ConvertReport convert_part(VolumeSource& source, const StoreLayout& layout,
                           const std::filesystem::path& out, const ConvertOptions& options,
                           Progress& progress);

}  // namespace isobrick
