#include "bricks/ranges/stored_ranges.h"

#include "bricks/ranges/checksummed_json.h"
#include "bricks/zarr/json_reader.h"
#include "io/bytes/file.h"

namespace isobrick {
namespace {

constexpr int kVersion = 3;

}  // namespace

std::filesystem::path ranges_file(const std::filesystem::path& store) {
  return store / "isobrick" / "ranges.json";
}

std::string to_json(const StoredRanges& stored) {
  nlohmann::json json = nlohmann::json::object();
  json["isobrick_ranges"] = kVersion;
  json["may_have_nan"] = stored.may_have_nan;
  json["image_crc32c"] = stored.image_crc32c;
  json["levels"] = nlohmann::json::array();
  for (const RangeChecksums& level : stored.levels)
    json["levels"].push_back({{"range_crc32c", level.bricks},
                              {"block_range_crc32c", level.blocks},
                              {"brick_crc32c", level.content}});
  return checksum_json(std::move(json));
}

StoredRanges parse_stored_ranges(std::string_view text, const std::string& where) {
  const nlohmann::json object = read_checksummed_json(text, where);
  const JsonReader json(object, where);
  json.at("isobrick_ranges")
      .check_version("ranges", kVersion, "remove the file and run isobrick index");
  StoredRanges stored{json.at("may_have_nan").boolean(),
                      static_cast<std::uint32_t>(json.at("image_crc32c").integer()),
                      {}};
  const JsonReader levels = json.at("levels");
  for (std::size_t i = 0; i < levels.array_size(); ++i) {
    const auto checksum = [level = levels.at(i)](const char* key) {
      return static_cast<std::uint32_t>(level.at(key).integer());
    };
    stored.levels.push_back({.bricks = checksum("range_crc32c"),
                             .blocks = checksum("block_range_crc32c"),
                             .content = checksum("brick_crc32c")});
  }
  return stored;
}

std::optional<StoredRanges> read_stored_ranges(const std::filesystem::path& store) {
  const std::filesystem::path file = ranges_file(store);
  const auto text = read_small_file(file, kMaxMetadataBytes);
  if (!text) return std::nullopt;
  return parse_stored_ranges(*text, quoted(file));
}

}  // namespace isobrick
