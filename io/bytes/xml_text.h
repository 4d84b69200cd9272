#pragma once

#include <string>
#include <string_view>

namespace isobrick::inline v0 {

/// Whether XML can hold the text: UTF-8 without control characters.
bool is_xml_text(std::string_view text);

/// For an attribute's value between double quotes.
std::string xml_escaped(std::string_view text);

}  // namespace isobrick
