#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace isobrick::inline v0 {

/// The first `most` characters of what somebody else wrote, fit for a line of a message:
/// everything but printable ASCII becomes '?'.
std::string printable(std::string_view text, std::size_t most);

}  // namespace isobrick
