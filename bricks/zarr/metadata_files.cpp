#include "bricks/zarr/metadata_files.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>

#include <isobrick/error.h>
#include "bricks/storage/open_storage.h"
#include "bricks/storage/storage_keys.h"
#include "bricks/zarr/json_reader.h"
#include "bricks/zarr/lone_array.h"
#include "bricks/zarr/store_names.h"
#include "bricks/zarr/zarr_v2.h"
#include "io/bytes/url.h"

namespace isobrick::inline v0 {
namespace {

namespace fs = std::filesystem;

/// Metadata in the words of Zarr version 3, and where it came from.
struct Text {
  std::string key;
  std::string json;
};

std::optional<std::string> read_text(const Storage& storage, const std::string& key) {
  return read_small_object(storage, key, kMaxMetadataBytes);
}

std::optional<Text> read_array(const Storage& storage, const std::string& folder) {
  const std::string v3 = join_key(folder, "zarr.json");
  if (auto text = read_text(storage, v3)) return Text{v3, std::move(*text)};
  const std::string v2 = join_key(folder, ".zarray"), attributes = join_key(folder, ".zattrs");
  const auto text = read_text(storage, v2);
  if (!text) return std::nullopt;
  Text array{v2, v3_from_zarray(*text, quoted(storage, v2))};
  if (const auto names = read_text(storage, attributes))
    array.json = with_dimension_names(array.json, *names, quoted(storage, attributes));
  return array;
}

/// A group in the words of version 3, or that of an array alone.
Text read_root(const Storage& storage) {
  for (const char* name : kZarrFiles) storage.will_open(name);
  const auto v3 = read_text(storage, "zarr.json");
  if (v3) {
    const nlohmann::json parsed = parse_json(*v3, quoted(storage, "zarr.json"));
    if (parsed.value("node_type", nlohmann::json()) != "array") return {"zarr.json", *v3};
  } else if (const auto attributes = read_text(storage, ".zattrs")) {
    if (std::string group = v3_from_zattrs(*attributes, quoted(storage, ".zattrs")); !group.empty())
      return {".zattrs", std::move(group)};
  }
  if (!v3 && storage.open(kLayoutMarker))
    throw Error(fmt::format("'{}' is unfinished: its conversion was interrupted; resume it",
                            storage.name()));
  if (const auto array = read_array(storage, "")) {
    const std::string where = quoted(storage, array->key);
    return {array->key, group_of(parse_array_metadata(array->json, where), where)};
  }
  if (storage.open(".zgroup"))
    throw Error(fmt::format(
        "'{}' is a group of Zarr version 2 without OME-NGFF multiscales: no image; name an image "
        "or an array in it, such as {}",
        storage.name(), quoted(storage, "0")));
  throw Error(fmt::format("'{}' is no store: it has no zarr.json", storage.name()));
}

// Our metadata has a checksum; that of others has only its syntax.
void check_ours(const MetadataFiles& files, const Storage& storage) {
  const std::string where = quoted(storage, files.root);
  if (!files.image.ours) {
    if (storage.open("isobrick/zarr.json"))
      throw DamageError(where + ": metadata was changed: attributes.isobrick is missing");
    return;
  }
  const std::optional<std::uint32_t>& checksum = files.image.checksum;
  if (!checksum)
    throw DamageError(where +
                      ": metadata was changed: attributes.isobrick.metadata_crc32c is missing");
  if (files.crc32c != *checksum)
    throw DamageError(
        fmt::format("{}: metadata was changed, here or in a level's zarr.json: its "
                    "checksum is {}, not metadata_crc32c {}",
                    where, files.crc32c, *checksum));
}

}  // namespace

MetadataFiles read_metadata_files(const Storage& storage) {
  const Text root = read_root(storage);
  const std::string root_name = quoted(storage, root.key);
  MetadataFiles files;
  files.root = root.key;
  files.image = parse_image_metadata(root.json, root_name);
  for (const ImageMetadata::Level& level : files.image.levels)
    for (const char* name : kZarrFiles)
      if ((root.key == "zarr.json") == (name == kZarrFiles.front()))
        storage.will_open(join_key(level.path, name));
  std::vector<std::string> texts;
  for (const ImageMetadata::Level& level : files.image.levels) {
    const std::string folder = join_key(level.path, "");
    auto text = read_array(storage, folder);
    if (!text) throw DamageError(quoted(storage, join_key(folder, "zarr.json")) + " is missing");
    files.levels.push_back({folder, text->key, {}});
    texts.push_back(std::move(text->json));
  }
  files.crc32c = metadata_checksum(root.json, texts, root_name);
  check_ours(files, storage);
  for (std::size_t i = 0; i < texts.size(); ++i) {
    const std::string where = quoted(storage, files.levels[i].file);
    files.levels[i].array = parse_array_metadata(texts[i], where);
    check_axis_order(files.levels[i].array, where);
  }
  return files;
}

bool is_zarr(const fs::path& path) {
  if (is_url(path.native())) return true;
  if (is_zip(path)) return true;
  return std::ranges::any_of(kZarrFiles, [&](const char* name) { return fs::exists(path / name); });
}

}  // namespace isobrick
