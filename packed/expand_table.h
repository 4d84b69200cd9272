#pragma once

#include <array>
#include <cstdint>

namespace isobrick::inline v0::packed {

/// For eight columns, those that are there as bits: of each the number of its byte among those that
/// are there, or 0x80 where it is zero.
inline constexpr std::array<std::uint64_t, 256> kExpand = [] {
  std::array<std::uint64_t, 256> table{};
  for (unsigned columns = 0; columns < 256; ++columns) {
    std::uint64_t next = 0;
    for (unsigned x = 0; x < 8; ++x)
      table[columns] |= (columns >> x & 1 ? next++ : std::uint64_t{0x80}) << (8 * x);
  }
  return table;
}();

}  // namespace isobrick::inline v0::packed
