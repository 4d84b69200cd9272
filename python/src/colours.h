#pragma once

#include <optional>
#include <string>
#include <tuple>

#include <isobrick/attributes.h>

namespace isobrick::python {

/// An attribute, the values with the first and the last colour, and the name of the scale; nothing:
/// no colours.
using ColourArguments = std::optional<std::tuple<std::string, double, double, std::string>>;

/// Throws UsageError for a scale that is not known and a file of a format without colours.
std::optional<AttributeColours> colours_of(const ColourArguments& arguments,
                                           const std::string& path);

}  // namespace isobrick::python
