#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace isobrick::inline v0 {

/// What is between the tags of the next element of a name from `at` on, which moves behind it;
/// nullopt: there is none.
std::optional<std::string> next_element(const std::string& xml, std::string_view name,
                                        std::size_t& at);

/// Names below a prefix in a reply of S3's ListObjectsV2, without the prefix. Throws Error for
/// another reply.
struct S3Listing {
  std::vector<std::string> names;
  std::string next;  ///< the token of the next part, or ""
};
S3Listing parse_s3_listing(const std::string& xml, const std::string& prefix);

}  // namespace isobrick
