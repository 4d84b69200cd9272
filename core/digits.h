#pragma once

#include <string_view>

namespace isobrick::inline v0 {

/// Whether `text` is one decimal digit or more, and nothing else.
inline bool is_digits(std::string_view text) {
  return !text.empty() && text.find_first_not_of("0123456789") == std::string_view::npos;
}

}  // namespace isobrick
