#include "pipeline/extract/resolve_index.h"

#include <fmt/format.h>

#include <array>
#include <string>

#include <isobrick/error.h>
#include "bricks/stored_index.h"

namespace isobrick::inline v0 {

namespace {

/// The stored index that finds blocks fastest, if one does at all: finer leaves
/// than the blocks themselves only add to what is read. The order is that of the
/// figures in docs/experiments/2026-11-index.md.
SearchMethod fastest(const StoreReader& store, int level) {
  constexpr std::array kinds{IndexKind::octree, IndexKind::kdtree, IndexKind::interval,
                             IndexKind::quadtree};
  for (const IndexKind kind : kinds) hint_index(store, level, std::string(name_of(kind)));
  for (const IndexKind kind : kinds) {
    const std::string name(name_of(kind));
    if (has_index(store, level, name) &&
        StoredIndex(store, level, name).layout().leaf == kBlockEdge)
      return {.kind = kind, .only_if_few = true};
  }
  return {};
}

}  // namespace

SearchMethod resolve_index(const StoreReader& store, int level, const IndexChoice& choice) {
  if (choice.automatic) return fastest(store, level);
  if (!choice.kind) return {};
  const std::string kind(name_of(*choice.kind));
  if (!has_index(store, level, kind))
    throw UsageError(fmt::format("level {} of '{}' has no {} index; run: {} --kind {}", level,
                                 store.info().name, kind, index_command(store.info()), kind));
  return {.kind = choice.kind, .only_if_few = false};
}

}  // namespace isobrick
