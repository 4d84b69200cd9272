#pragma once

#include <isobrick/store_reader.h>
#include "tools/options.h"

namespace isobrick::tools {

/// The box, in samples of `level`, that a command works on: what both parts of `region` have, or
/// all of it. Throws UsageError when the store has no such level or the region leaves it.
Box3 store_region(const StoreReader& store, int level, const RegionArguments& region);

}  // namespace isobrick::tools
