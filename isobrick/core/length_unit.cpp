#include "isobrick/core/length_unit.h"

#include <algorithm>
#include <iterator>

namespace isobrick {
namespace {

/// A unit of length; picometers make the factors between them exact.
struct LengthUnit {
  std::string_view symbol, name;
  double picometers;
};

/// The first symbol of a name is the one that is shown. Where none is in ASCII, files
/// have the name.
constexpr LengthUnit kUnits[] = {
    {"m", "meter", 1e12},      {"dm", "decimeter", 1e11}, {"cm", "centimeter", 1e10},
    {"mm", "millimeter", 1e9}, {"µm", "micrometer", 1e6}, {"μm", "micrometer", 1e6},
    {"um", "micrometer", 1e6}, {"nm", "nanometer", 1e3},  {"pm", "picometer", 1},
    {"km", "kilometer", 1e15}, {"in", "inch", 2.54e10},   {"ft", "foot", 3.048e11},
    {"Å", "angstrom", 100},    {"å", "angstrom", 100},    {"mi", "mile", 1.609344e15},
};

template <class Condition>
const LengthUnit* find(Condition condition) {
  const auto* const found = std::find_if(std::begin(kUnits), std::end(kUnits), condition);
  return found == std::end(kUnits) ? nullptr : found;
}

bool is_ascii(std::string_view text) {
  return std::all_of(text.begin(), text.end(),
                     [](char c) { return static_cast<unsigned char>(c) < 0x80; });
}

}  // namespace

std::string unit_name(std::string_view unit) {
  const auto* const known =
      find([&](const LengthUnit& u) { return unit == u.symbol || unit == u.name; });
  if (known != nullptr) return std::string(known->name);
  if (unit == "micron" || unit == "microns") return "micrometer";
  // Lengths that OME-Zarr names and hardly anybody uses.
  const bool length = unit.ends_with("meter") || unit == "yard" || unit == "parsec";
  return length ? std::string(unit) : std::string();
}

std::optional<double> unit_ratio(std::string_view unit, std::string_view other) {
  if (unit == other) return 1;
  const auto* const a = find([&](const LengthUnit& u) { return u.name == unit; });
  const auto* const b = find([&](const LengthUnit& u) { return u.name == other; });
  if (a == nullptr || b == nullptr) return std::nullopt;
  return a->picometers / b->picometers;
}

std::string unit_symbol(std::string_view name) {
  const auto* const known = find([&](const LengthUnit& u) { return u.name == name; });
  return std::string(known == nullptr ? name : known->symbol);
}

std::string ascii_unit_symbol(std::string_view name) {
  const auto* const known =
      find([&](const LengthUnit& u) { return u.name == name && is_ascii(u.symbol); });
  return std::string(known == nullptr ? name : known->symbol);
}

}  // namespace isobrick
