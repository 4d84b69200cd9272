#include "bricks/ranges/checksummed_json.h"

#include <fmt/format.h>

#include <bit>
#include <cstdint>

#include "bricks/zarr/codec.h"
#include "bricks/zarr/json_reader.h"

namespace isobrick::inline v0 {
namespace {

constexpr const char* kKey = "crc32c";

/// Fractions as the bits of a double, so that nothing depends on how their decimals are chosen.
void replace_fractions(nlohmann::json& json) {
  if (json.is_number_float())
    json = fmt::format("{:016x}", std::bit_cast<std::uint64_t>(json.get<double>()));
  else if (json.is_structured())
    for (nlohmann::json& element : json) replace_fractions(element);
}

std::uint32_t checksum_of(nlohmann::json object) {
  replace_fractions(object);
  const std::string text = object.dump();
  return crc32c(std::as_bytes(std::span(text)));
}

}  // namespace

std::string checksum_json(nlohmann::json object) {
  object[kKey] = checksum_of(object);
  return object.dump(2) + "\n";
}

nlohmann::json read_checksummed_json(std::string_view text, const std::string& where) {
  nlohmann::json object = parse_json(text, where);
  const JsonReader checked(object, where);
  const Index stored = checked.at(kKey).integer();
  object.erase(kKey);
  if (const std::uint32_t crc = checksum_of(object); Index{crc} != stored)
    JsonReader(object, where)
        .damaged(fmt::format("was changed: its checksum is {}, not crc32c {}", crc, stored));
  return object;
}

std::uint32_t json_checksum(std::string_view text) {
  return parse_json(text, "").at(kKey).get<std::uint32_t>();
}

}  // namespace isobrick
