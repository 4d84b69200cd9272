#pragma once

#include <string_view>

namespace isobrick::inline v0 {

/// Whether a text is a URL of a scheme that can be read: http, https or s3.
inline bool is_url(std::string_view text) {
  return text.starts_with("http://") || text.starts_with("https://") || text.starts_with("s3://");
}

}  // namespace isobrick
