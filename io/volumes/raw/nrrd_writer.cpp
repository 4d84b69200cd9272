#include "io/volumes/raw/nrrd_writer.h"

#include <fmt/format.h>

#include "core/length_unit.h"
#include "core/printable.h"
#include "io/volumes/raw/nrrd_header.h"

namespace isobrick::inline v0 {
namespace {

std::string vector_text(Vec3d v) { return fmt::format("({},{},{})", v.x, v.y, v.z); }

/// A key/value pair, of which readers of NRRD keep what they do not know.
std::string pair_text(const char* key, const std::string& value) {
  std::string escaped;
  for (const char c : value) {
    if (c == '\\') escaped += '\\';
    escaped += c;
  }
  return fmt::format("{}:={}\n", key, escaped);
}

}  // namespace

std::string nrrd_header_text(const VolumeInfo& info, const std::string& data_file) {
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
    text += fmt::format("space units: \"{0}\" \"{0}\" \"{0}\"\n", ascii_unit_symbol(t.unit));
  text += "endian: little\nencoding: raw\n";
  if (!info.grid_class.empty())
    text += pair_text(kNrrdGridClass, printable(info.grid_class, info.grid_class.size()));
  if (!info.grid_name.empty())
    text += pair_text(kNrrdGridName, printable(info.grid_name, info.grid_name.size()));
  if (!info.grid_class.empty() || info.fill_value != 0)
    text += pair_text(kNrrdFillValue, info.fill_value.text());
  return text + (data_file.empty() ? "\n" : fmt::format("data file: {}\n", data_file));
}

}  // namespace isobrick
