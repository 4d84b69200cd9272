#pragma once

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

}  // namespace isobrick
