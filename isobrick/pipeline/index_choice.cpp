#include "isobrick/pipeline/index_choice.h"

#include <fmt/format.h>

#include "isobrick/bricks/stored_index.h"
#include "isobrick/core/error.h"

namespace isobrick {

std::optional<IndexKind> resolve_index(const StoreReader& store, int level,
                                       const IndexChoice& choice) {
  // The block ranges are the fastest in every measurement of docs/index.md.
  if (choice.automatic || !choice.kind) return std::nullopt;
  const std::string kind(name_of(*choice.kind));
  if (!has_index(store.info().path, level, kind))
    throw UsageError(
        fmt::format("level {} of '{}' has no {} index; 'isobrick index {} --kind {}' "
                    "adds it",
                    level, store.info().path.string(), kind, store.info().path.string(), kind));
  return choice.kind;
}

}  // namespace isobrick
