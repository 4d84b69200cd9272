#pragma once

#include <optional>

#include <isobrick/index_kind.h>

namespace isobrick::inline v0 {

/// How an extraction finds the active blocks. The mesh is the same.
struct IndexChoice {
  bool automatic = true;          ///< whatever is expected to be fastest
  std::optional<IndexKind> kind;  ///< otherwise: that index; nullopt: the block ranges
};

}  // namespace isobrick
