#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

namespace isobrick {

/// The text of an object with one more member, `crc32c`: the CRC-32C of the
/// object without it, written with sorted keys and without blanks. Its numbers
/// are integers, so that there is one way to write it.
std::string seal_json(nlohmann::json object);

/// The object in `text`, without its checksum. Throws DamageError naming `where`
/// when the checksum is missing or another.
nlohmann::json unseal_json(std::string_view text, const std::string& where);

/// The checksum that seal_json() put into `text`.
std::uint32_t seal_of(std::string_view text);

}  // namespace isobrick
