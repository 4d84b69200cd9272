#pragma once

#include <optional>

#include "isobrick/bricks/store_reader.h"
#include "isobrick/index/index_kind.h"

namespace isobrick {

/// How an extraction is told to find the active blocks.
struct IndexChoice {
  bool automatic = true;          ///< whatever is expected to be fastest
  std::optional<IndexKind> kind;  ///< otherwise: that index; nothing: the block ranges
};

/// The index that a level is searched with; nothing: the block ranges. Throws
/// UsageError when the level lacks the one that was asked for.
std::optional<IndexKind> resolve_index(const StoreReader& store, int level,
                                       const IndexChoice& choice);

}  // namespace isobrick
