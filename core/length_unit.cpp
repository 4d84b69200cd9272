#include "core/length_unit.h"

#include <algorithm>
#include <iterator>

namespace isobrick::inline v0 {
namespace {

/// A unit of length; picometers make the factors between the usual ones exact.
struct LengthUnit {
  std::string_view symbol, name;
  double picometers;
};

/// The units that OME-Zarr names, which are UDUNITS-2's. The first symbol of a name is the one
/// that is shown. Where none is in ASCII, files have the name.
constexpr LengthUnit kUnits[] = {
    {"m", "meter", 1e12},
    {"dm", "decimeter", 1e11},
    {"cm", "centimeter", 1e10},
    {"mm", "millimeter", 1e9},
    {"µm", "micrometer", 1e6},
    {"μm", "micrometer", 1e6},
    {"um", "micrometer", 1e6},
    {"nm", "nanometer", 1e3},
    {"pm", "picometer", 1},
    {"km", "kilometer", 1e15},
    {"in", "inch", 2.54e10},
    {"ft", "foot", 3.048e11},
    {"Å", "angstrom", 100},
    {"å", "angstrom", 100},
    {"mi", "mile", 1.609344e15},
    {"yd", "yard", 9.144e11},
    {"fm", "femtometer", 1e-3},
    {"am", "attometer", 1e-6},
    {"zm", "zeptometer", 1e-9},
    {"ym", "yoctometer", 1e-12},
    {"hm", "hectometer", 1e14},
    {"Mm", "megameter", 1e18},
    {"Gm", "gigameter", 1e21},
    {"Tm", "terameter", 1e24},
    {"Pm", "petameter", 1e27},
    {"Em", "exameter", 1e30},
    {"Zm", "zettameter", 1e33},
    {"Ym", "yottameter", 1e36},
    {"pc", "parsec", 3.0856775814913673e28},
};

/// Other spellings of the same: capitals, plurals, British ones, and "micron". Symbols, whose
/// case is part of the unit (Mm, mm), stay as they are.
std::string singular(std::string_view unit) {
  std::string name(unit);
  for (char& c : name)
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  if (name == "micron" || name == "microns") return "micrometer";
  if (name == "feet") return "foot";
  if (name == "inches") return "inch";
  if (name.ends_with("s") && name.size() > 3) name.pop_back();
  if (name.ends_with("metre")) name.replace(name.size() - 2, 2, "er");
  return name;
}

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
  const std::string other = singular(unit);
  const auto* const known =
      find([&](const LengthUnit& u) { return unit == u.symbol || other == u.name; });
  return known == nullptr ? std::string() : std::string(known->name);
}

std::string no_unit_text(std::string_view text) {
  std::string message("'");
  message.append(text).append("' is no unit of length; it is one of ").append(unit_names());
  return message;
}

std::string unit_names() {
  std::string names;
  std::string_view last;
  for (const LengthUnit& unit : kUnits) {
    if (unit.name == last) continue;
    names += names.empty() ? "" : ", ";
    names += unit.name;
    last = unit.name;
  }
  return names;
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
