#include "bricks/ranges/index_layout.h"

#include <fmt/format.h>

#include "bricks/ranges/checksummed_json.h"
#include "bricks/zarr/json_reader.h"

namespace isobrick::inline v0 {
namespace {

constexpr int kVersion = 2;

ScalarType parse_type(const JsonReader& json) {
  const auto type = parse_scalar_type(json.string());
  if (!type || json.string() != zarr_name(*type)) json.damaged("is no data type");
  return *type;
}

Int3 parse_extent(const JsonReader& json) {
  if (json.array_size() != 3) json.damaged("must have 3 numbers");
  return {json.at(std::size_t{2}).positive(), json.at(std::size_t{1}).positive(),
          json.at(std::size_t{0}).positive()};
}

}  // namespace

std::string to_json(const IndexLayout& layout) {
  nlohmann::json json = nlohmann::json::object();
  json["isobrick_index"] = kVersion;
  json["kind"] = layout.kind;
  json["leaf"] = layout.leaf;
  json["data_type"] = zarr_name(layout.type);
  json["shape"] = {layout.extent.z, layout.extent.y, layout.extent.x};
  json["brick"] = IndexLayout::kBrick;
  json["chunk"] = IndexLayout::kChunk * IndexLayout::kBrick;
  json["zstd_level"] = nullptr;
  if (layout.zstd_level) json["zstd_level"] = *layout.zstd_level;
  json["ranges_crc32c"] = layout.ranges_crc32c;
  return checksum_json(std::move(json));
}

std::uint32_t checksum_of(const IndexLayout& layout) { return json_checksum(to_json(layout)); }

IndexLayout parse_index_layout(std::string_view text, const std::string& where) {
  const nlohmann::json object = read_checksummed_json(text, where);
  const JsonReader json(object, where);
  json.at("isobrick_index")
      .check_version("index", kVersion, "isobrick index --force makes it anew");
  if (json.at("brick").integer() != IndexLayout::kBrick ||
      json.at("chunk").integer() != IndexLayout::kChunk * IndexLayout::kBrick)
    json.damaged("index bricks have 64 cells, chunks 512");
  IndexLayout layout;
  layout.kind = json.string_at("kind");
  layout.leaf = json.at("leaf").integer();
  const bool has_labels = layout.kind == kLabelIndex;
  if (has_labels ? layout.leaf != kLabelLeaf : !is_index_leaf(layout.leaf))
    json.at("leaf").damaged("must be 1, 2, 4, 8 or 16, of labels 32");
  layout.type = parse_type(json.at("data_type"));
  layout.extent = parse_extent(json.at("shape"));
  if (!json.at("zstd_level").raw().is_null())
    layout.zstd_level = static_cast<int>(json.at("zstd_level").integer());
  layout.ranges_crc32c = static_cast<std::uint32_t>(json.at("ranges_crc32c").integer());
  return layout;
}

}  // namespace isobrick
