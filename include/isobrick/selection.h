#pragma once

#include <optional>
#include <string>

#include <isobrick/api.h>
#include <isobrick/vec.h>

namespace isobrick::inline v0 {

/// Which of several volumes in one file is meant, counted from 0.
struct Selection {
  std::optional<Index> channel = {};  ///< nothing: the only one
  std::optional<Index> time = {};     ///< nothing: the only one
};

/// The place on an axis of `count` channels or times that is chosen. `option` is
/// "--channel" or "--time". Throws UsageError, beginning with `path`, for one
/// that must be chosen and was not, and for one that is not there.
ISOBRICK_API Index choose(const std::string& path, const char* option, Index count,
                          std::optional<Index> chosen);

}  // namespace isobrick
