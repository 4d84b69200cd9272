#include "isobrick/bricks/metadata_files.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>

#include "isobrick/bricks/checked_json.h"
#include "isobrick/bricks/store_names.h"
#include "isobrick/bricks/zarr_v2.h"
#include "isobrick/core/error.h"
#include "isobrick/io/file.h"

namespace isobrick {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

/// Metadata in the words of Zarr version 3, and where it came from.
struct Text {
  fs::path file;
  std::string json;
};

std::optional<std::string> read_text(const fs::path& file) {
  return read_small_file(file, kMaxMetadataBytes);
}

/// An array of version 2 with the names that xarray and others give its dimensions in .zattrs.
std::string with_dimension_names(std::string array, const fs::path& folder) {
  const auto text = read_text(folder / ".zattrs");
  if (!text) return array;
  const nlohmann::json attributes = parse_json(*text, quoted(folder / ".zattrs"));
  if (!attributes.is_object() || !attributes.contains("_ARRAY_DIMENSIONS")) return array;
  nlohmann::json named = nlohmann::json::parse(array);
  named["dimension_names"] = attributes["_ARRAY_DIMENSIONS"];
  return named.dump();
}

/// Dimensions named x, y and z in another order would be taken for z, y, x: a mirrored volume.
void check_order(const ArrayMetadata& array, const std::string& where) {
  std::string letters, all;  // of each dimension one; '-': none of space
  for (const std::string& name : array.dimension_names) {
    const char letter = name.size() == 1 ? static_cast<char>(name[0] | 0x20) : '-';
    letters += letter >= 'x' && letter <= 'z' ? letter : '-';
    all += (all.empty() ? "" : ", ") + name;
  }
  const bool named = std::ranges::count(letters, '-') + 3 == std::ssize(letters);
  if (named && !letters.ends_with("zyx"))
    throw Error(
        fmt::format("{}: its dimensions are {}: only arrays whose last are z, y, x are read; write "
                    "it transposed",
                    where, all));
}

std::optional<Text> read_array(const fs::path& folder) {
  if (auto text = read_text(folder / "zarr.json"))
    return Text{folder / "zarr.json", std::move(*text)};
  const fs::path file = folder / ".zarray";
  if (const auto text = read_text(file))
    return Text{file, with_dimension_names(v3_from_zarray(*text, quoted(file)), folder)};
  return std::nullopt;
}

/// Names of an array's axes before its last three: those that it says itself. Where it says
/// none, five dimensions are t, c, z, y, x, and other axes have no name ("?").
std::vector<std::string> leading_names(const ArrayMetadata& array) {
  const std::size_t count = array.shape.size() - 3;
  std::vector<std::string> names(count, "?");
  if (count == 2) names = {"t", "c"};
  for (std::size_t i = 0; i < count && array.dimension_names.size() == array.shape.size(); ++i)
    if (const std::string& name = array.dimension_names[i]; !name.empty()) names[i] = name;
  return names;
}

/// The group that has nothing but this array, at ".".
std::string group_of(const ArrayMetadata& array, const std::string& where) {
  if (array.shape.size() < 3)
    throw Error(
        fmt::format("{}: arrays of {} dimensions are no volumes", where, array.shape.size()));
  Json axes = Json::array();
  for (const std::string& name : leading_names(array)) axes.push_back({{"name", name}});
  for (const char* name : {"z", "y", "x"}) axes.push_back({{"name", name}});
  const std::vector<int> ones(array.shape.size(), 1);
  Json dataset{{"path", "."}};
  dataset["coordinateTransformations"] = Json::array({Json{{"type", "scale"}, {"scale", ones}}});
  Json multiscale{{"axes", std::move(axes)}, {"datasets", Json::array({std::move(dataset)})}};
  Json group{{"zarr_format", 3}, {"node_type", "group"}};
  group["attributes"]["ome"] = {{"version", "0.5"},
                                {"multiscales", Json::array({std::move(multiscale)})}};
  return group.dump();
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

// Metadata of ours says what it must be; that of others has only its syntax.
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
    check_order(files.levels[i].array, quoted(files.levels[i].file));
  }
  return files;
}

bool is_zarr(const fs::path& path) {
  for (const char* name : {"zarr.json", ".zattrs", ".zgroup", ".zarray"})
    if (fs::exists(path / name)) return true;
  return false;
}

}  // namespace isobrick
