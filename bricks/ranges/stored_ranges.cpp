#include "bricks/ranges/stored_ranges.h"

#include "bricks/ranges/checksummed_json.h"
#include "bricks/storage/storage_keys.h"
#include "bricks/zarr/json_reader.h"

namespace isobrick::inline v0 {
namespace {

constexpr int kVersion = 3;

nlohmann::json json_of(const StoredHistogram& histogram) {
  const HistogramBins& bins = histogram.bins;
  nlohmann::json json{{"exponent", bins.exponent}, {"first_bin", bins.first},
                      {"bins", bins.count},        {"not_a_number", bins.not_a_number},
                      {"infinite", bins.infinite}, {"crc32c", histogram.crc32c}};
  if (bins.count > 0) json.update({{"lo", bins.lo}, {"hi", bins.hi}});
  return json;
}

StoredHistogram parse_histogram(const JsonReader& json) {
  StoredHistogram histogram;
  HistogramBins& bins = histogram.bins;
  bins.exponent = static_cast<int>(json.at("exponent").integer());
  bins.first = json.at("first_bin").integer();
  bins.count = json.at("bins").integer();
  bins.not_a_number = static_cast<std::uint64_t>(json.at("not_a_number").integer());
  bins.infinite = static_cast<std::uint64_t>(json.at("infinite").integer());
  histogram.crc32c = static_cast<std::uint32_t>(json.at("crc32c").integer());
  if (bins.count < 0 || bins.count > kMaxHistogramBins)
    json.damaged("has an impossible number of bins");
  if (bins.exponent < -1074 || bins.exponent > 1023)
    json.damaged("has an impossible width of bins");
  if (bins.count == 0) return histogram;
  bins.lo = json.at("lo").number();
  bins.hi = json.at("hi").number();
  if (!(bins.lo <= bins.hi)) json.damaged("has an impossible range");
  return histogram;
}

}  // namespace

std::string ranges_file(const std::string& additions) {
  return join_key(additions, "isobrick/ranges.json");
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
  if (stored.histogram) json["histogram"] = json_of(*stored.histogram);
  return checksum_json(std::move(json));
}

StoredRanges parse_stored_ranges(std::string_view text, const std::string& where) {
  const nlohmann::json object = read_checksummed_json(text, where);
  const JsonReader json(object, where);
  json.at("isobrick_ranges")
      .check_version("ranges", kVersion, "remove the file and run isobrick index");
  StoredRanges stored{json.at("may_have_nan").boolean(),
                      static_cast<std::uint32_t>(json.at("image_crc32c").integer()),
                      {},
                      std::nullopt};
  const JsonReader levels = json.at("levels");
  for (std::size_t i = 0; i < levels.array_size(); ++i) {
    const auto checksum = [level = levels.at(i)](const char* key) {
      return static_cast<std::uint32_t>(level.at(key).integer());
    };
    stored.levels.push_back({.bricks = checksum("range_crc32c"),
                             .blocks = checksum("block_range_crc32c"),
                             .content = checksum("brick_crc32c")});
  }
  if (json.has("histogram")) stored.histogram = parse_histogram(json.at("histogram"));
  return stored;
}

std::optional<StoredRanges> read_stored_ranges(const Storage& storage,
                                               const std::string& additions) {
  const std::string key = ranges_file(additions);
  const auto text = read_small_object(storage, key, kMaxMetadataBytes);
  if (!text) return std::nullopt;
  return parse_stored_ranges(*text, quoted(storage, key));
}

}  // namespace isobrick
