#include "io/meshes/vtp_layout.h"

#include <fmt/format.h>

#include <bit>
#include <cstring>
#include <limits>

#include "io/meshes/append_items.h"

namespace isobrick::inline v0 {
namespace {

static_assert(std::endian::native == std::endian::little, "numbers are written as they lie");

/// Twenty digits in each place and the longest unit fill some 1400.
constexpr std::size_t kHeaderBytes = 1536;
/// What the declaration of an attribute adds, but for its name.
constexpr std::size_t kAttributeBytes = 128;

std::string data_array(std::string_view type, std::string_view name, int components,
                       std::uint64_t offset) {
  return fmt::format(
      "        <DataArray type=\"{}\" Name=\"{}\" NumberOfComponents=\"{}\" format=\"appended\" "
      "offset=\"{}\"/>\n",
      type, name, components, offset);
}

/// VTK's strings in text: the codes of their characters and a zero.
std::string unit_field(std::string_view unit) {
  if (unit.empty()) return {};
  std::string codes;
  for (const char c : unit) codes += fmt::format("{} ", static_cast<unsigned>(c));
  return fmt::format(
      "    <FieldData>\n      <Array type=\"String\" Name=\"unit\" NumberOfTuples=\"1\" "
      "format=\"ascii\">{}0</Array>\n    </FieldData>\n",
      codes);
}

template <class Number, class F>
void append_numbers(FileWriter& out, std::uint64_t count, const F& number) {
  append_items<sizeof(Number)>(out, count, [&](std::byte* to, std::uint64_t i) {
    const auto value = static_cast<Number>(number(i));
    std::memcpy(to, &value, sizeof(Number));
  });
}

template <class F>
void append_numbers(FileWriter& out, bool wide, std::uint64_t count, const F& number) {
  if (wide)
    append_numbers<std::int64_t>(out, count, number);
  else
    append_numbers<std::int32_t>(out, count, number);
}

}  // namespace

bool VtpLayout::wide() const {
  constexpr std::uint64_t most = std::numeric_limits<std::int32_t>::max();
  return has_wide_numbers || size.vertices > most || size.triangles > most / 3;
}

std::uint64_t VtpLayout::connectivity_bytes() const {
  return size.triangles * 3 * (wide() ? sizeof(std::int64_t) : sizeof(std::int32_t));
}

std::uint64_t VtpLayout::offset_bytes() const { return connectivity_bytes() / 3; }

std::string VtpLayout::header() const {
  constexpr std::uint64_t length = sizeof(std::uint64_t);
  const std::string_view number = wide() ? "Int64" : "Int32";
  std::uint64_t offset = length + point_bytes();
  std::string active, arrays;
  if (normals) {
    active += " Normals=\"Normals\"";
    arrays += data_array("Float32", "Normals", 3, offset);
    offset += length + point_bytes();
  }
  for (const std::string& name : attributes) {
    arrays += data_array("Float32", name, 1, offset);
    offset += length + attribute_bytes();
  }
  if (global_ids) {
    active += fmt::format(" GlobalIds=\"{}\"", kGlobalIds);
    arrays += data_array("Int64\" IdType=\"1", kGlobalIds, 1, offset);
    offset += length + global_id_bytes();
  }
  std::string text = fmt::format(
      "<?xml version=\"1.0\"?>\n"
      "<VTKFile type=\"PolyData\" version=\"1.0\" byte_order=\"LittleEndian\" "
      "header_type=\"UInt64\">\n"
      "  <PolyData>\n{}"
      "    <Piece NumberOfPoints=\"{}\" NumberOfVerts=\"0\" NumberOfLines=\"0\" "
      "NumberOfStrips=\"0\" NumberOfPolys=\"{}\">\n"
      "      <PointData{}>\n{}      </PointData>\n"
      "      <Points>\n{}      </Points>\n      <Polys>\n{}{}      </Polys>\n"
      "    </Piece>\n  </PolyData>\n",
      unit_field(unit), size.vertices, size.triangles, active, arrays,
      data_array("Float32", "Points", 3, 0), data_array(number, "connectivity", 1, offset),
      data_array(number, "offsets", 1, offset + length + connectivity_bytes()));
  constexpr std::string_view data = "\n  <AppendedData encoding=\"raw\">\n   _";
  std::size_t bytes = kHeaderBytes + (global_ids ? 2 * kAttributeBytes : 0);
  for (const std::string& name : attributes) bytes += kAttributeBytes + name.size();
  text.resize(bytes - data.size(), ' ');
  return text.append(data);
}

void append_length(FileWriter& out, std::uint64_t bytes) {
  out.append(std::as_bytes(std::span(&bytes, 1)));
}

void append_connectivity(FileWriter& out, const VtpLayout& layout,
                         std::span<const Triangle> triangles) {
  if (!layout.wide()) {
    out.append(std::as_bytes(triangles));
    return;
  }
  append_numbers<std::int64_t>(out, 3 * triangles.size(),
                               [&](std::uint64_t i) { return triangles[i / 3][i % 3]; });
}

void append_vtp_end(FileWriter& out, const VtpLayout& layout) {
  append_length(out, layout.offset_bytes());
  append_numbers(out, layout.wide(), layout.size.triangles,
                 [](std::uint64_t i) { return 3 * (i + 1); });
  out.append("\n  </AppendedData>\n</VTKFile>\n");
}

}  // namespace isobrick
