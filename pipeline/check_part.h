#pragma once

#include <cstddef>
#include <cstdint>
#include <set>
#include <string>

#include <fmt/format.h>

#include <isobrick/error.h>
#include <isobrick/part.h>

namespace isobrick::inline v0 {

/// Throws UsageError for a part that there is not.
inline void check_part(Part part) {
  if (part.number < 1 || part.number > part.count || part.count > kMaxParts)
    throw UsageError(fmt::format(
        "there is no part {} of {}: parts are numbered from 1, and there are at most {}",
        part.number, part.count, kMaxParts));
}

/// Numbers of parts for a message: the first of them, and how many there are more.
inline std::string numbers_of_parts(const std::set<std::uint32_t>& parts) {
  constexpr std::size_t shown = 8;
  std::string text;
  std::size_t count = 0;
  for (const std::uint32_t part : parts) {
    if (++count > shown) return text + fmt::format(" and {} more", parts.size() - shown);
    text += fmt::format("{}{}", count > 1 ? ", " : "", part);
  }
  return text;
}

}  // namespace isobrick
