#include "bricks/store_layout.h"

#include <fmt/format.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include <isobrick/error.h>
#include "bricks/zarr/json_reader.h"
#include "bricks/zarr/ome_transformations.h"
#include "bricks/zarr/zarr_v2.h"

namespace isobrick::inline v0 {
namespace {

nlohmann::json marker_json(const StoreLayout& layout) {
  nlohmann::json marker = nlohmann::json::object();
  marker["isobrick_layout"] = kStoreVersion;
  marker["image"] = nlohmann::json::parse(to_json(image_metadata(layout)));
  marker["arrays"] = nlohmann::json::array();
  for (const LevelInfo& level : layout.levels)
    marker["arrays"].push_back(nlohmann::json::parse(to_json(array_metadata(level, layout))));
  return marker;
}

/// The root's file of another store with the checksum of this one.
std::string kept_root(const std::string& root, bool v2, std::optional<std::uint32_t> checksum) {
  auto json = nlohmann::ordered_json::parse(root);
  json.erase("consolidated_metadata");  // which may list the codecs of the other one
  if (checksum) (v2 ? json : json.at("attributes")).at("isobrick")["metadata_crc32c"] = *checksum;
  return json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

}  // namespace

ArrayMetadata array_metadata(const LevelInfo& level, const StoreLayout& layout) {
  ArrayMetadata array;
  const Int3 e = level.lattice.extent, b = level.lattice.brick, s = level.shard;
  array.shape = {e.z, e.y, e.x};
  array.chunk = {s.z, s.y, s.x};
  array.type = level.lattice.type;
  array.fill_value = layout.fill_value;
  array.codecs = layout.codecs();
  if (layout.ome == OmeVersion::v04) {
    array.key_prefix = false;
    return array;
  }
  array.sharding = ArrayMetadata::Sharding{.brick = {b.z, b.y, b.x}};
  array.dimension_names = {"z", "y", "x"};
  return array;
}

ImageMetadata image_metadata(const StoreLayout& layout) {
  ImageMetadata image;
  image.name = layout.name;
  image.grid_class = layout.grid_class;
  image.grid_name = layout.grid_name;
  image.labels = layout.labels;
  if (layout.levels.size() > 1) image.downsampling = name_of(layout.downsampling);
  for (std::size_t i = 0; i < layout.levels.size(); ++i)
    image.levels.push_back({std::to_string(i), layout.levels[i].transform});
  return image;
}

RootFile root_file(const ImageMetadata& image, const StoreLayout& layout) {
  const bool v2 = layout.ome == OmeVersion::v04;
  if (!layout.root.empty())
    return {v2 ? ".zattrs" : "zarr.json", kept_root(layout.root, v2, image.checksum)};
  if (v2) return {".zattrs", to_zattrs(image)};
  return {"zarr.json", to_json(image)};
}

void check_layout(const StoreLayout& layout) {
  if (layout.levels.empty()) throw UsageError("a store needs at least one level");
  for (std::size_t i = 0; i < layout.levels.size(); ++i) {
    const LevelInfo& level = layout.levels[i];
    if (level.lattice.type != layout.levels[0].lattice.type)
      throw UsageError("all levels of a store have the same type");
    if (!checked_volume(level.lattice.extent)) throw UsageError("extents are out of bounds");
    if (layout.ome == OmeVersion::v04 && level.shard != level.lattice.brick)
      throw UsageError("Zarr version 2 has no shards");
    const Transform& transform = level.transform;
    for (int axis = 0; axis < 3; ++axis) {
      if (level.lattice.extent[axis] > kMaxAxisSamples)
        throw UsageError(
            fmt::format("more than {} samples along an axis are not supported", kMaxAxisSamples));
      if (!(transform.spacing[axis] > 0) || !std::isfinite(transform.spacing[axis]))
        throw Error(fmt::format("level {}: a spacing of {} is not finite and positive", i,
                                transform.spacing[axis]));
      if (!std::isfinite(transform.origin[axis]))
        throw Error(
            fmt::format("level {}: an origin of {} is not finite", i, transform.origin[axis]));
    }
    if (!is_orthonormal(transform.direction))
      throw Error(fmt::format("level {}: the axes' directions are not orthonormal", i));
    fill_bits(level.lattice.type, layout.fill_value);
    // Limits on extents, bricks and shards are checked in one place only: the parser.
    parse_array_metadata(to_json(array_metadata(level, layout)), fmt::format("level {}", i));
  }
  parse_image_metadata(to_json(image_metadata(layout)), "metadata");
}

std::string layout_marker(const StoreLayout& layout) { return marker_json(layout).dump(1) + "\n"; }

void check_same_layout(std::string_view marker, const StoreLayout& layout, const std::string& file,
                       const std::string& store) {
  const nlohmann::json begun = parse_json(marker, file), wanted = marker_json(layout);
  if (begun == wanted) return;
  const nlohmann::json differences = nlohmann::json::diff(begun, wanted);
  throw Error(fmt::format("{} was begun with another layout ({} differs); resume with the same one",
                          store, differences.at(0).at("path").get<std::string>()));
}

// Zarr version 2 writes the same values in other words; the checksum is over those of version 3.
std::uint32_t layout_checksum(const ImageMetadata& image, const StoreLayout& layout,
                              const std::string& where) {
  const bool v2 = layout.ome == OmeVersion::v04;
  std::vector<std::string> arrays;
  for (const LevelInfo& level : layout.levels) {
    const ArrayMetadata array = array_metadata(level, layout);
    arrays.push_back(v2 ? v3_from_zarray(to_zarray(array), where) : to_json(array));
  }
  const std::string root = root_file(image, layout).json;
  return metadata_checksum(v2 ? v3_from_zattrs(root, where) : root, arrays, where);
}

}  // namespace isobrick
