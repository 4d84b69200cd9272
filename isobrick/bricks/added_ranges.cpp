#include "isobrick/bricks/added_ranges.h"

#include <fmt/format.h>

#include "isobrick/bricks/checked_json.h"
#include "isobrick/bricks/sealed_json.h"
#include "isobrick/bricks/store_file.h"

namespace isobrick {
namespace {

constexpr int kVersion = 2;

}  // namespace

std::filesystem::path added_ranges_file(const std::filesystem::path& store) {
  return store / "isobrick" / "ranges.json";
}

std::string to_json(const AddedRanges& added) {
  nlohmann::json json;
  json["isobrick_ranges"] = kVersion;
  json["may_have_nan"] = added.may_have_nan;
  json["image_crc32c"] = added.image_crc32c;
  json["levels"] = nlohmann::json::array();
  for (const RangeChecksums& level : added.levels)
    json["levels"].push_back({{"range_crc32c", level.bricks}, {"block_range_crc32c", level.blocks}});
  return seal_json(std::move(json));
}

std::optional<AddedRanges> read_added_ranges(const std::filesystem::path& store) {
  const std::filesystem::path file = added_ranges_file(store);
  bool exists = false;
  const std::string text = read_small_file(file, kMaxMetadataBytes, &exists);
  if (!exists) return std::nullopt;
  const nlohmann::json object = unseal_json(text, quoted(file));
  const CheckedJson json(object, quoted(file));
  if (const Index version = json.at("isobrick_ranges").integer(); version != kVersion)
    json.unsupported(fmt::format(
        "ranges version {} is not known to this program, which knows {}; remove the file and run "
        "isobrick index",
        version, kVersion));
  AddedRanges added{json.at("may_have_nan").boolean(),
                    static_cast<std::uint32_t>(json.at("image_crc32c").integer()),
                    {}};
  const CheckedJson levels = json.at("levels");
  for (std::size_t i = 0; i < levels.array_size(); ++i)
    added.levels.push_back(
        {static_cast<std::uint32_t>(levels.at(i).at("range_crc32c").integer()),
         static_cast<std::uint32_t>(levels.at(i).at("block_range_crc32c").integer())});
  return added;
}

}  // namespace isobrick
