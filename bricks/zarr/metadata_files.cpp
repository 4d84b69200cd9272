#include "bricks/zarr/metadata_files.h"

#include <fmt/format.h>

#include <optional>

#include <isobrick/error.h>
#include "bricks/zarr/json_reader.h"
#include "bricks/zarr/lone_array.h"
#include "bricks/zarr/store_names.h"
#include "bricks/zarr/zarr_v2.h"
#include "io/bytes/file.h"

namespace isobrick {
namespace {

namespace fs = std::filesystem;

/// Metadata in the words of Zarr version 3, and where it came from.
struct Text {
  fs::path file;
  std::string json;
};

std::optional<std::string> read_text(const fs::path& file) {
  return read_small_file(file, kMaxMetadataBytes);
}

std::optional<Text> read_array(const fs::path& folder) {
  if (auto text = read_text(folder / "zarr.json"))
    return Text{folder / "zarr.json", std::move(*text)};
  const fs::path file = folder / ".zarray", attributes = folder / ".zattrs";
  const auto text = read_text(file);
  if (!text) return std::nullopt;
  Text array{file, v3_from_zarray(*text, quoted(file))};
  if (const auto names = read_text(attributes))
    array.json = with_dimension_names(array.json, *names, quoted(attributes));
  return array;
}

/// A group in the words of version 3, or that of an array alone.
Text read_root(const fs::path& path) {
  const auto v3 = read_text(path / "zarr.json");
  if (v3) {
    const nlohmann::json parsed = parse_json(*v3, quoted(path / "zarr.json"));
    if (parsed.value("node_type", nlohmann::json()) != "array") return {path / "zarr.json", *v3};
  } else if (const auto attributes = read_text(path / ".zattrs")) {
    const fs::path file = path / ".zattrs";
    if (std::string group = v3_from_zattrs(*attributes, quoted(file)); !group.empty())
      return {file, std::move(group)};
  }
  if (!v3 && fs::exists(path / kLayoutMarker))
    throw Error(fmt::format("'{}' is unfinished: its conversion was interrupted; resume it",
                            path.string()));
  if (const auto array = read_array(path))
    return {array->file,
            group_of(parse_array_metadata(array->json, quoted(array->file)), quoted(array->file))};
  if (fs::exists(path / ".zgroup"))
    throw Error(fmt::format(
        "'{}' is a group of Zarr version 2 without OME-NGFF multiscales: no image; name an image "
        "or an array in it, such as '{}'",
        path.string(), (path / "0").string()));
  throw Error(fmt::format("'{}' is no store: it has no zarr.json", path.string()));
}

// Our metadata has a checksum; that of others has only its syntax.
void check_ours(const MetadataFiles& files, const fs::path& path) {
  const std::string where = quoted(files.root);
  if (!files.image.ours) {
    if (fs::exists(path / "isobrick" / "zarr.json"))
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

MetadataFiles read_metadata_files(const fs::path& path) {
  if (!fs::is_directory(path))
    throw Error(fmt::format("'{}' is no store: not a directory", path.string()));
  const Text root = read_root(path);
  MetadataFiles files;
  files.root = root.file;
  files.image = parse_image_metadata(root.json, quoted(root.file));
  std::vector<std::string> texts;
  for (const ImageMetadata::Level& level : files.image.levels) {
    const fs::path folder = path / level.path;
    auto text = read_array(folder);
    if (!text) throw DamageError(quoted(folder / "zarr.json") + " is missing");
    files.levels.push_back({folder, text->file, {}});
    texts.push_back(std::move(text->json));
  }
  files.crc32c = metadata_checksum(root.json, texts, quoted(root.file));
  check_ours(files, path);
  for (std::size_t i = 0; i < texts.size(); ++i) {
    files.levels[i].array = parse_array_metadata(texts[i], quoted(files.levels[i].file));
    check_axis_order(files.levels[i].array, quoted(files.levels[i].file));
  }
  return files;
}

bool is_zarr(const fs::path& path) {
  for (const char* name : {"zarr.json", ".zattrs", ".zgroup", ".zarray"})
    if (fs::exists(path / name)) return true;
  return false;
}

}  // namespace isobrick
