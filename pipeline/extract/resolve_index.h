#pragma once

#include "isobrick/bricks/store_reader.h"
#include "isobrick/pipeline/index_choice.h"
#include "isobrick/stream/block_search.h"

namespace isobrick {

/// How a level is searched. Throws UsageError when the level lacks the index that was asked for.
SearchBy resolve_index(const StoreReader& store, int level, const IndexChoice& choice);

}  // namespace isobrick
