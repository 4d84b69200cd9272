#include "isobrick/volumes/nrrd_writer.h"

#include <fmt/format.h>

#include <array>
#include <utility>

namespace isobrick {
namespace {

/// As other programs write lengths; others keep their name.
std::string unit_symbol(const std::string& unit) {
  constexpr std::array<std::pair<std::string_view, std::string_view>, 7> symbols{
      {{"meter", "m"},
       {"centimeter", "cm"},
       {"millimeter", "mm"},
       {"micrometer", "um"},
       {"nanometer", "nm"},
       {"picometer", "pm"},
       {"kilometer", "km"}}};
  for (const auto& [name, symbol] : symbols)
    if (unit == name) return std::string(symbol);
  return unit;
}

std::string vector_text(Vec3d v) { return fmt::format("({},{},{})", v.x, v.y, v.z); }

}  // namespace

std::string nrrd_header_text(const VolumeInfo& info) {
  const Transform& t = info.transform;
  std::string text = fmt::format(
      "NRRD0004\n# Isobrick\ntype: {}\ndimension: 3\nsizes: {} {} {}\nspace dimension: 3\n"
      "space directions: {} {} {}\nspace origin: {}\nkinds: domain domain domain\n",
      info.type == ScalarType::f32   ? "float"
      : info.type == ScalarType::f64 ? "double"
                                     : zarr_name(info.type),
      info.extent.x, info.extent.y, info.extent.z, vector_text(t.step(0)), vector_text(t.step(1)),
      vector_text(t.step(2)), vector_text(t.origin));
  if (!t.unit.empty())
    text += fmt::format("space units: \"{0}\" \"{0}\" \"{0}\"\n", unit_symbol(t.unit));
  return text + "endian: little\nencoding: raw\n\n";
}

}  // namespace isobrick
