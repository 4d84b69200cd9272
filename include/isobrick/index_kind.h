#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

namespace isobrick::inline v0 {

/// The structures that answer which ranges an isovalue stabs.
enum class IndexKind : std::uint8_t { linear, interval, kdtree, quadtree, octree };

inline constexpr IndexKind kIndexKinds[] = {IndexKind::linear, IndexKind::interval,
                                            IndexKind::kdtree, IndexKind::quadtree,
                                            IndexKind::octree};

/// "linear", "interval", …: the names of the command line and of stores.
constexpr std::string_view name_of(IndexKind kind) {
  constexpr std::string_view names[] = {"linear", "interval", "kdtree", "quadtree", "octree"};
  return names[static_cast<int>(kind)];
}

constexpr std::optional<IndexKind> parse_index_kind(std::string_view name) {
  for (IndexKind kind : kIndexKinds)
    if (name == name_of(kind)) return kind;
  return std::nullopt;
}

}  // namespace isobrick
