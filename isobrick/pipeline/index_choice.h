#pragma once

#include <optional>

#include "isobrick/bricks/store_reader.h"
#include "isobrick/stream/block_search.h"

namespace isobrick {

/// How an extraction is told to find the active blocks.
struct IndexChoice {
  bool automatic = true;          ///< whatever is expected to be fastest
  std::optional<IndexKind> kind;  ///< otherwise: that index; nothing: the block ranges
};

/// How a level is searched then. Throws UsageError when the level lacks the index
/// that was asked for.
SearchBy resolve_index(const StoreReader& store, int level, const IndexChoice& choice);

}  // namespace isobrick
