#include "tools/index_options.h"

#include <fmt/format.h>

#include "index/leaf_ranges.h"

namespace isobrick::tools {
namespace {

std::optional<IndexKind> stored_kind(const std::string& text) {
  const auto kind = parse_index_kind(text);
  return kind == IndexKind::linear ? std::nullopt : kind;
}

}  // namespace

IndexKind parse_stored_kind(const std::string& text) {
  if (const auto kind = stored_kind(text)) return *kind;
  throw UsageError(fmt::format(
      "unknown kind '{}'; the kinds are interval, kdtree, quadtree, octree and labels", text));
}

IndexChoice parse_index_choice(const std::string& text) {
  if (text == "auto") return {};
  if (text == "linear") return {.automatic = false, .kind = std::nullopt};
  if (const auto kind = stored_kind(text)) return {.automatic = false, .kind = kind};
  throw UsageError(fmt::format(
      "unknown search '{}'; it is auto, linear, interval, kdtree, quadtree or octree", text));
}

void add_leaf(CLI::App* app, Index& leaf) {
  const auto parse = [](const std::string& text) {
    const Index cells = parse_whole(text, 1, 16);
    if (is_leaf(cells)) return cells;
    throw UsageError(fmt::format("'{}' is no leaf; it is 1, 2, 4, 8 or 16", text));
  };
  add_parsed(app, leaf, parse,
             {"--leaf", "1|2|4|8|16", "Cells along each edge of an item of the index",
              std::to_string(kDefaultLeaf)});
}

}  // namespace isobrick::tools
