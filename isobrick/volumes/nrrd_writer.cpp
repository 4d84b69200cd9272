#include "isobrick/volumes/nrrd_writer.h"

#include <fmt/format.h>

#include "isobrick/core/length_unit.h"

namespace isobrick {
namespace {

std::string vector_text(Vec3d v) { return fmt::format("({},{},{})", v.x, v.y, v.z); }

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
  return text + (data_file.empty() ? "\n" : fmt::format("data file: {}\n", data_file));
}

}  // namespace isobrick
