#include "bricks/store_entries.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <limits>
#include <string_view>

#include <isobrick/error.h>
#include "bricks/ranges/index_layout.h"
#include "bricks/ranges/range_format.h"
#include "bricks/zarr/json_reader.h"
#include "bricks/zarr/store_names.h"
#include "bricks/zarr/zarr_v2.h"
#include "core/digits.h"
#include "io/bytes/file.h"
#include "io/bytes/folder_walk.h"
#include "io/bytes/leftovers.h"
#include "io/bytes/output_guard.h"

namespace isobrick::inline v0 {
namespace {

namespace fs = std::filesystem;

constexpr std::array<std::string_view, 5> kKinds{"interval", "kdtree", "quadtree", "octree",
                                                 kLabelIndex};
constexpr std::array<std::string_view, 3> kItems{"range", "block_range", "brick_crc32c"};
constexpr std::string_view kHistogram = "histogram";
constexpr Index kAnyNumber = std::numeric_limits<Index>::max();

template <std::size_t N>
bool is_one_of(std::string_view name, const std::array<std::string_view, N>& names) {
  return std::ranges::find(names, name) != names.end();
}

/// `name` without `suffix`, if it ends so.
std::string_view without(std::string_view name, std::string_view suffix) {
  if (name.ends_with(suffix)) name.remove_suffix(suffix.size());
  return name;
}

/// The number that `name` is, as we write it; nothing for other names.
std::optional<Index> number_of(std::string_view name) {
  if (!is_digits(name) || name.size() > 18 || (name.size() > 1 && name.front() == '0'))
    return std::nullopt;
  return std::stoll(std::string(name));
}

bool is_number_below(std::string_view name, Index count) {
  const auto number = number_of(name);
  return number && *number < count;
}

/// Whether `names` are z, y, x of a chunk within `grid`, and a 0 for each axis more; of a folder
/// the first of them.
bool is_chunk(std::span<const std::string> names, Int3 grid, std::size_t more, bool folder) {
  const std::size_t count = 3 + more;
  if (folder ? names.size() >= count : names.size() != count) return false;
  const std::array<Index, 4> counts{grid.z, grid.y, grid.x, 1};
  for (std::size_t i = 0; i < names.size(); ++i)
    if (!is_number_below(names[i], counts[i])) return false;
  return true;
}

/// The same below a folder "c".
bool is_chunk_below_c(std::span<const std::string> names, Int3 grid, std::size_t more,
                      bool folder) {
  return !names.empty() && names.front() == "c" && is_chunk(names.subspan(1), grid, more, folder);
}

/// Whether `names` are the array of a histogram, which is one chunk, or are in it.
bool is_histogram(std::span<const std::string> names, bool folder) {
  if (names.size() == 1) return names[0] == (folder ? "c" : "zarr.json");
  return names.size() == 2 && !folder && names[0] == "c" && names[1] == "0";
}

std::optional<nlohmann::json> read_json(const fs::path& file) {
  const auto text = read_small_file(file, kMaxMetadataBytes);
  if (!text) return std::nullopt;
  return parse_json(*text, quoted(file));
}

/// The root's attributes, of whichever version of Zarr; null when there are none.
nlohmann::json read_attributes(const fs::path& folder) {
  if (const auto root = read_json(folder / "zarr.json"))
    return root->is_object() ? root->value("attributes", *root) : *root;
  if (const auto attributes = read_json(folder / ".zattrs")) return *attributes;
  return {};
}

/// How many levels attributes name; Error when they do not.
std::size_t count_levels(const nlohmann::json& attributes, const std::string& where) {
  JsonReader image(attributes, where);
  if (image.has("ome")) image = image.at("ome");
  return image.at("multiscales").at(std::size_t{0}).at("datasets").array_size();
}

/// The metadata of a level's array.
ArrayMetadata read_level(const fs::path& folder) {
  if (const auto text = read_small_file(folder / "zarr.json", kMaxMetadataBytes))
    return parse_array_metadata(*text, quoted(folder / "zarr.json"));
  const fs::path file = folder / ".zarray";
  const auto text = read_small_file(file, kMaxMetadataBytes);
  if (!text) throw DamageError(quoted(folder / "zarr.json") + " is missing");
  return parse_array_metadata(v3_from_zarray(*text, quoted(file)), quoted(file));
}

/// The levels' arrays.
std::vector<ArrayMetadata> read_arrays(const fs::path& folder, bool unfinished) {
  std::vector<ArrayMetadata> arrays;
  if (unfinished) {
    const std::string where = quoted(folder / kLayoutMarker);
    const nlohmann::json marker = read_json(folder / kLayoutMarker).value_or(nlohmann::json());
    const JsonReader levels = JsonReader(marker, where).at("arrays");
    for (std::size_t i = 0; i < levels.array_size(); ++i)
      arrays.push_back(parse_array_metadata(levels.at(i).raw().dump(), where));
    return arrays;
  }
  const std::size_t count = count_levels(read_attributes(folder), quoted(folder));
  for (std::size_t i = 0; i < count; ++i) arrays.push_back(read_level(folder / std::to_string(i)));
  return arrays;
}

/// What the root's metadata shows of who wrote it; empty if it was us.
std::string why_not_our_metadata(const fs::path& folder) {
  for (const char* name : {"zarr.json", ".zattrs"}) {
    const auto root = read_json(folder / name);
    if (!root) continue;
    const nlohmann::json attributes = read_attributes(folder);
    const bool ours = attributes.is_object() && attributes.contains("isobrick");
    return ours ? "" : fmt::format("its {} is another program's", name);
  }
  return "it has no zarr.json";
}

}  // namespace

StoreEntries StoreEntries::of(const fs::path& folder) {
  StoreEntries store;
  store.unfinished_ = fs::exists(fs::symlink_status(folder / kLayoutMarker));
  try {
    for (const ArrayMetadata& array : read_arrays(folder, store.unfinished_))
      store.add_level(array);
  } catch (const Error& error) {
    store.any_ = true;
    store.why_ = fmt::format("its metadata does not list what belongs to it: {}", error.what());
  }
  return store;
}

StoreEntries StoreEntries::of(std::span<const LevelInfo> levels) {
  StoreEntries store;
  for (const LevelInfo& level : levels) {
    const Int3 e = level.lattice.extent, b = level.lattice.brick;
    ArrayMetadata array;
    array.shape = {e.z, e.y, e.x};
    array.chunk = {b.z, b.y, b.x};
    store.add_level(array);
  }
  return store;
}

void StoreEntries::add_level(const ArrayMetadata& array) {
  if (array.shape.size() != 3) throw DamageError("a level has not three dimensions");
  const auto vector = [](const std::vector<Index>& zyx) { return Int3{zyx[2], zyx[1], zyx[0]}; };
  const Lattice lattice{vector(array.shape), vector(array.brick()), array.type};
  const auto chunks = [](Int3 items) { return ceil_div(items, range_chunk_extent(items)); };
  IndexLayout index;
  index.extent = lattice.extent;
  levels_.push_back({.first = array.key_prefix ? "c" : "",
                     .shards = ceil_div(lattice.extent, vector(array.chunk)),
                     .bricks = chunks(lattice.bricks()),
                     .blocks = chunks(lattice.blocks()),
                     .index_chunks = index.chunks()});
}

const StoreEntries::Level* StoreEntries::level(const std::string& name) const {
  static const Level any{"c",
                         {kAnyNumber, kAnyNumber, kAnyNumber},
                         {kAnyNumber, kAnyNumber, kAnyNumber},
                         {kAnyNumber, kAnyNumber, kAnyNumber},
                         {kAnyNumber, kAnyNumber, kAnyNumber}};
  if (any_) return number_of(name) ? &any : nullptr;
  if (!is_number_below(name, static_cast<Index>(levels_.size()))) return nullptr;
  return &levels_[static_cast<std::size_t>(*number_of(name))];
}

bool StoreEntries::has_at_root(const std::string& name, bool folder) const {
  if (folder) return name == "isobrick" || level(name) != nullptr;
  constexpr std::array<std::string_view, 5> files{"zarr.json", ".zgroup", ".zattrs", kLayoutMarker,
                                                  kConvertJournal};
  return is_one_of(name, files) ||
         (unfinished_ && (name == "spool" || is_temporary_of(name, "spool")));
}

bool StoreEntries::has_in_level(const Level& l, Names names, bool folder) const {
  if (names.empty()) return folder;
  if (!folder && names.size() == 1 && (names[0] == "zarr.json" || names[0] == ".zarray"))
    return true;
  const bool version2 = is_chunk(names, l.shards, 0, folder);
  const bool version3 = is_chunk_below_c(names, l.shards, 0, folder);
  return any_ ? version2 || version3 : l.first.empty() ? version2 : version3;
}

/// What lies below isobrick/.
bool StoreEntries::has_addition(Names names, bool folder) const {
  if (names.empty()) return folder;
  if (names.size() == 1 && !folder) return names[0] == "zarr.json" || names[0] == "ranges.json";
  const Level* const l = level(names[0]);
  if (!l) return false;
  const bool finest = names[0] == "0";
  names = names.subspan(1);
  if (names.empty()) return folder;
  if (names.size() == 1 && !folder) return names[0] == "zarr.json";
  const bool index = names[0] == "index";
  if (index) names = names.subspan(1);
  if (names.empty()) return folder;
  const std::string_view name = without(without(names[0], ".partial"), ".replaced");
  const bool histogram = !index && finest && name == kHistogram;
  if (!histogram && !(index ? is_one_of(name, kKinds) : is_one_of(name, kItems))) return false;
  names = names.subspan(1);
  if (names.empty()) return folder;
  if (histogram) return is_histogram(names, folder);
  if (names.size() == 1 && !folder)
    return index ? names[0] == "index.json" : names[0] == "zarr.json" || names[0] == "checksums";
  if (index) return is_chunk_below_c(names, l->index_chunks, 0, folder);
  if (name == "brick_crc32c") return is_chunk_below_c(names, l->bricks, 0, folder);
  return is_chunk_below_c(names, name == "range" ? l->bricks : l->blocks, 1, folder);
}

bool StoreEntries::has(const fs::path& path, fs::file_type type) const {
  const bool folder = type == fs::file_type::directory;
  if (!folder && type != fs::file_type::regular) return false;
  std::vector<std::string> names;
  for (const fs::path& name : path)
    if (!name.empty()) names.push_back(name.string());
  if (names.empty()) return folder;
  const bool addition = names.front() == "isobrick";
  if (!folder && is_temporary_name(path)) {
    if (!addition && !unfinished_ && !any_) return false;
    names.back() = fs::path(names.back()).stem().string();
  }
  const Names rest = Names(names).subspan(1);
  if (rest.empty()) return has_at_root(names.front(), folder);
  if (addition) return has_addition(rest, folder);
  const Level* const l = level(names.front());
  return l && has_in_level(*l, rest, folder);
}

std::optional<fs::path> find_foreign_entry(const fs::path& folder, const StoreEntries& store,
                                           const fs::path& place) {
  std::optional<fs::path> foreign;
  walk_folder(folder, [&](const fs::path& path, fs::file_type type) {
    if (!store.has(place / path, type)) foreign = path;
    return !foreign;
  });
  return foreign;
}

std::string why_not_our_store(const fs::path& folder) {
  if (fs::symlink_status(folder).type() != fs::file_type::directory) return "it is no folder";
  if (fs::is_empty(folder)) return "";
  const StoreEntries store = StoreEntries::of(folder);
  // First what else is there: that is what would be lost.
  if (const auto foreign = find_foreign_entry(folder, store))
    return fmt::format("it holds '{}', which is no part of a store", foreign->string());
  try {
    const std::string why = why_not_our_metadata(folder);
    return why.empty() ? store.why() : why;
  } catch (const Error& error) {
    return error.what();
  }
}

void check_replaceable(const fs::path& folder, const StoreEntries& store, const fs::path& place,
                       std::span<const fs::path> inputs) {
  const fs::file_type type = fs::symlink_status(folder).type();
  if (type == fs::file_type::not_found) return;
  if (type != fs::file_type::directory)
    throw UsageError(fmt::format("'{}' is no folder: it is not replaced", folder.string()));
  if (const auto foreign = find_foreign_entry(folder, store, place))
    throw UsageError(
        fmt::format("'{}' holds '{}', which is no part of a store: it is not replaced; move that "
                    "away",
                    folder.string(), foreign->string()));
  check_replaces_no_input(folder, inputs);
}

}  // namespace isobrick
