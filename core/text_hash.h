#pragma once

#include <cstdint>
#include <string_view>

namespace isobrick::inline v0 {

/// FNV-1a, 64 bits: short names of files for long texts. No protection against texts that were made
/// to have the hash of another.
inline std::uint64_t text_hash(std::string_view text) {
  std::uint64_t hash = 0xcbf29ce484222325;
  for (const char c : text) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001b3;
  return hash;
}

}  // namespace isobrick
