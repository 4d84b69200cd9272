#include "bricks/ranges/sealed_json.h"

#include <fmt/format.h>

#include "bricks/zarr/checked_json.h"
#include "bricks/zarr/codec.h"

namespace isobrick {
namespace {

constexpr const char* kKey = "crc32c";

std::uint32_t checksum_of(const nlohmann::json& object) {
  const std::string text = object.dump();
  return crc32c(std::as_bytes(std::span(text)));
}

}  // namespace

std::string seal_json(nlohmann::json object) {
  object[kKey] = checksum_of(object);
  return object.dump(2) + "\n";
}

nlohmann::json unseal_json(std::string_view text, const std::string& where) {
  nlohmann::json object = parse_json(text, where);
  const CheckedJson checked(object, where);
  const Index stored = checked.at(kKey).integer();
  object.erase(kKey);
  if (const std::uint32_t crc = checksum_of(object); Index{crc} != stored)
    CheckedJson(object, where)
        .damaged(fmt::format("was changed: its checksum is {}, not crc32c {}", crc, stored));
  return object;
}

std::uint32_t seal_of(std::string_view text) {
  return parse_json(text, "").at(kKey).get<std::uint32_t>();
}

}  // namespace isobrick
