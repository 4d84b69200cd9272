#pragma once

#include <optional>

#include <isobrick/store_reader.h>
#include "tools/parse.h"

namespace isobrick::tools {

/// The box, in samples of `level`, that a command works on: `roi` or all of it.
/// Throws UsageError when the store has no such level or the region leaves it.
Box3 store_region(const StoreReader& store, int level, const std::optional<RoiText>& roi);

}  // namespace isobrick::tools
