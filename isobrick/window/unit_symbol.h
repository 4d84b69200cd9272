#pragma once

#include <array>
#include <string>
#include <string_view>
#include <utility>

namespace isobrick {

/// The symbol of a unit of length that OME-Zarr names ("micrometer": "µm"), or its own
/// name where it has none here.
inline std::string unit_symbol(const std::string& name) {
  static constexpr std::array<std::pair<std::string_view, std::string_view>, 12> kSymbols{{
      {"angstrom", "\u00c5"},
      {"picometer", "pm"},
      {"nanometer", "nm"},
      {"micrometer", "\u00b5m"},
      {"millimeter", "mm"},
      {"centimeter", "cm"},
      {"decimeter", "dm"},
      {"meter", "m"},
      {"kilometer", "km"},
      {"inch", "in"},
      {"foot", "ft"},
      {"mile", "mi"},
  }};
  for (const auto& [unit, symbol] : kSymbols)
    if (name == unit) return std::string(symbol);
  return name;
}

}  // namespace isobrick
