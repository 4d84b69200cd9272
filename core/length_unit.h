#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace isobrick::inline v0 {

// Units of length: their names, which are those of OME-Zarr ("micrometer"), and
// what else they are called. Text is UTF-8.

/// "mm" → "millimeter" and so on; what is no unit of length becomes empty.
std::string unit_name(std::string_view unit);

/// All names, for messages: "meter, decimeter, …".
std::string unit_names();

/// Why a text is no unit of length, with the names that are.
std::string no_unit_text(std::string_view text);

/// How many of `other` are one of `unit`, both as unit_name() has them; nothing
/// where that is not known.
std::optional<double> unit_ratio(std::string_view unit, std::string_view other);

/// The symbol of a unit for people to read ("micrometer" → "µm"), or its own name
/// where it has none.
std::string unit_symbol(std::string_view name);

/// The same in ASCII ("um"), for files.
std::string ascii_unit_symbol(std::string_view name);

}  // namespace isobrick
