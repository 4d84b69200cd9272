#pragma once

#include <isobrick/index_choice.h>
#include <isobrick/store_reader.h>
#include "stream/block_search.h"

namespace isobrick::inline v0 {

/// How a level is searched. Throws UsageError when the level lacks the requested index.
SearchMethod resolve_index(const StoreReader& store, int level, const IndexChoice& choice);

}  // namespace isobrick
