#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

namespace isobrick::inline v0 {

/// The text of an object with one more member, `crc32c`: the CRC-32C of the
/// object without it, written with sorted keys and without blanks. Its numbers
/// are integers, so that there is one way to write it.
std::string checksum_json(nlohmann::json object);

/// The object in `text`, without its checksum. Throws DamageError naming `where`
/// when the checksum is missing or another.
nlohmann::json read_checksummed_json(std::string_view text, const std::string& where);

/// The checksum that checksum_json() put into `text`.
std::uint32_t json_checksum(std::string_view text);

}  // namespace isobrick
