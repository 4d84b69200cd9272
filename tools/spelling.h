#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace isobrick::tools {

/// The word that `typed` was probably meant to be: the one that the fewest edits (insertions,
/// deletions, replacements, exchanges of neighbours) lead to; empty if all are far from it.
std::string nearest_word(std::string_view typed, const std::vector<std::string>& words);

}  // namespace isobrick::tools
