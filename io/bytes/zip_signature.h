#pragma once

#include <string_view>

namespace isobrick::inline v0 {

/// Whether a file that begins with these bytes is a zip: with an entry, or without any.
inline bool is_zip_head(std::string_view head) {
  return head.starts_with("PK\x03\x04") || head.starts_with("PK\x05\x06");
}

}  // namespace isobrick
