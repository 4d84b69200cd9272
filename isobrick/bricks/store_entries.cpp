#include "isobrick/bricks/store_entries.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string_view>

#include "isobrick/bricks/checked_json.h"
#include "isobrick/bricks/store_names.h"
#include "isobrick/core/digits.h"
#include "isobrick/core/error.h"
#include "isobrick/io/file.h"
#include "isobrick/io/output_guard.h"

namespace isobrick {
namespace {

namespace fs = std::filesystem;

/// Every file of a store; # is a number, KIND a kind of index: docs/reference/store_format.md.
constexpr std::array<std::string_view, 18> kFiles{"zarr.json",
                                                  ".zgroup",
                                                  ".zattrs",
                                                  kLayoutMarker,
                                                  kConvertJournal,
                                                  "spool",
                                                  "#/zarr.json",
                                                  "#/.zarray",
                                                  "#/c/#/#/#",
                                                  "#/#/#/#",
                                                  "isobrick/zarr.json",
                                                  "isobrick/ranges.json",
                                                  "isobrick/#/zarr.json",
                                                  "isobrick/#/RANGES/zarr.json",
                                                  "isobrick/#/RANGES/checksums",
                                                  "isobrick/#/RANGES/c/#/#/#/#",
                                                  "isobrick/#/index/KIND/index.json",
                                                  "isobrick/#/index/KIND/c/#/#/#"};
constexpr std::array<std::string_view, 4> kKinds{"interval", "kdtree", "quadtree", "octree"};
constexpr std::array<std::string_view, 2> kRanges{"range", "block_range"};

/// `name` without `suffix`, if it ends so.
std::string_view without(std::string_view name, std::string_view suffix) {
  if (name.ends_with(suffix)) name.remove_suffix(suffix.size());
  return name;
}

/// The name as kFiles has it.
std::string name_pattern(const std::string& name) {
  if (is_digits(name)) return "#";
  if (name.starts_with("spool.partial-")) return "spool";
  const std::string_view folder = without(without(name, ".partial"), ".replaced");
  if (std::ranges::find(kKinds, folder) != kKinds.end()) return "KIND";
  if (std::ranges::find(kRanges, folder) != kRanges.end()) return "RANGES";
  return name;
}

std::string pattern_of(const fs::path& path) {
  std::string pattern;
  for (const fs::path& name : path) {
    if (!pattern.empty()) pattern += '/';
    pattern += name_pattern(name.string());
  }
  return pattern;
}

bool is_known(const fs::path& path, fs::file_type type) {
  if (type == fs::file_type::directory)
    return std::ranges::any_of(kFiles, [folder = pattern_of(path / "")](std::string_view file) {
      return file.starts_with(folder);
    });
  if (type != fs::file_type::regular) return false;
  const fs::path name = is_temporary_name(path) ? fs::path(path).replace_extension() : path;
  return std::ranges::find(kFiles, pattern_of(name)) != kFiles.end();
}

/// What the root's metadata shows of who wrote it; empty if it was us.
std::string why_not_our_metadata(const fs::path& folder) {
  for (const char* name : {"zarr.json", ".zattrs"}) {
    const fs::path file = folder / name;
    const auto text = read_small_file(file, kMaxMetadataBytes);
    if (!text) continue;
    const nlohmann::json root = parse_json(*text, quoted(file));
    const nlohmann::json attributes = root.is_object() ? root.value("attributes", root) : root;
    const bool ours = attributes.is_object() && attributes.contains("isobrick");
    return ours ? "" : fmt::format("its {} is another program's", name);
  }
  return "it has no zarr.json";
}

}  // namespace

std::optional<fs::path> find_foreign_entry(const fs::path& folder, const fs::path& place) {
  for (auto entry = fs::recursive_directory_iterator(folder); entry != fs::end(entry); ++entry) {
    const fs::path path = entry->path().lexically_relative(folder);
    if (!is_known(place / path, entry->symlink_status().type())) return path;
  }
  return std::nullopt;
}

std::string why_not_our_store(const fs::path& folder) {
  if (fs::symlink_status(folder).type() != fs::file_type::directory) return "it is no folder";
  if (fs::is_empty(folder)) return "";
  // First what else is there: that is what would be lost.
  if (const auto foreign = find_foreign_entry(folder))
    return fmt::format("it holds '{}', which is no part of a store", foreign->string());
  try {
    return why_not_our_metadata(folder);
  } catch (const Error& error) {
    return error.what();
  }
}

void check_replaceable(const fs::path& folder, const fs::path& place,
                       std::span<const fs::path> inputs) {
  const fs::file_type type = fs::symlink_status(folder).type();
  if (type == fs::file_type::not_found) return;
  if (type != fs::file_type::directory)
    throw UsageError(fmt::format("'{}' is no folder: it is not replaced", folder.string()));
  if (const auto foreign = find_foreign_entry(folder, place))
    throw UsageError(
        fmt::format("'{}' holds '{}', which is no part of a store: it is not replaced; move that "
                    "away",
                    folder.string(), foreign->string()));
  check_replaces_no_input(folder, inputs);
}

}  // namespace isobrick
