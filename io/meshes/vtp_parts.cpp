#include "io/meshes/vtp_parts.h"

#include <fmt/format.h>

#include <cstring>
#include <filesystem>

#include <isobrick/error.h>
#include "io/bytes/leftovers.h"
#include "io/bytes/xml_text.h"
#include "io/meshes/append_items.h"
#include "io/meshes/vertex_rows.h"
#include "io/meshes/vtp_layout.h"

namespace isobrick::inline v0 {
namespace {

/// Appends the bytes [first, first + kBytes) of each row.
template <std::size_t kBytes>
void append_column(FileWriter& out, std::span<const std::byte> rows, std::size_t row,
                   std::size_t first) {
  append_items<kBytes>(out, rows.size() / row, [&](std::byte* to, std::uint64_t i) {
    std::memcpy(to, rows.data() + i * row + first, kBytes);
  });
}

void append_global_ids(FileWriter& out, const MeshPart& part) {
  append_items<sizeof(std::int64_t)>(out, part.vertices(), [&](std::byte* to, std::uint64_t i) {
    const std::uint64_t vertex =
        i < part.own_vertices ? part.first_vertex + i : part.borrowed[i - part.own_vertices];
    std::memcpy(to, &vertex, sizeof(vertex));
  });
}

/// The declaration of what the points of all parts have.
std::string point_data_text(const MeshHeader& header) {
  std::string text = fmt::format("    <PPointData{} GlobalIds=\"{}\">\n",
                                 header.has_normals ? " Normals=\"Normals\"" : "", kGlobalIds);
  const auto declare = [&](std::string_view type, std::string_view name, int components) {
    text += fmt::format("      <PDataArray type=\"{}\" Name=\"{}\" NumberOfComponents=\"{}\"/>\n",
                        type, name, components);
  };
  if (header.has_normals) declare("Float32", "Normals", 3);
  for (const std::string& name : header.attributes) declare("Float32", name, 1);
  declare("Int64\" IdType=\"1", kGlobalIds, 1);
  return text + "    </PPointData>\n";
}

}  // namespace

void check_pvtp_name(const std::string& path) {
  if (path == kStandardOutput)
    throw UsageError(
        "a .pvtp has several files, which standard output cannot take; name a file, or choose the "
        "format VTP");
  const std::string name = std::filesystem::path(path).filename().string();
  if (!is_xml_text(name))
    throw UsageError(fmt::format(
        "'{}': a .pvtp names its parts after itself in XML, which takes no name that is not "
        "UTF-8 or has control characters; choose another name",
        path));
}

void write_vtp_part(FileWriter& out, const StoredMesh& mesh, const MeshHeader& header,
                    const MeshPart& part) {
  const VtpLayout layout{.size = {part.vertices(), part.triangles},
                         .normals = header.has_normals,
                         .unit = header.unit,
                         .attributes = header.attributes,
                         .global_ids = true};
  const std::size_t vectors = row_bytes(header.has_normals);
  out.append(layout.header());
  for (std::size_t column = 0; column < vectors; column += sizeof(Vec3f)) {
    append_length(out, layout.point_bytes());
    for_each_row_batch(mesh, part, [&](std::span<const std::byte> rows) {
      append_column<sizeof(Vec3f)>(out, rows, mesh.row_bytes, column);
    });
  }
  for (std::size_t column = vectors; column < mesh.row_bytes; column += sizeof(float)) {
    append_length(out, layout.attribute_bytes());
    for_each_row_batch(mesh, part, [&](std::span<const std::byte> rows) {
      append_column<sizeof(float)>(out, rows, mesh.row_bytes, column);
    });
  }
  append_length(out, layout.global_id_bytes());
  append_global_ids(out, part);
  append_length(out, layout.connectivity_bytes());
  for_each_triangle_batch(mesh, part, [&](std::span<const Triangle> triangles) {
    append_connectivity(out, layout, triangles);
  });
  append_vtp_end(out, layout);
}

std::string pvtp_index(const MeshHeader& header, const PartedOutput& output,
                       std::span<const std::uint32_t> parts) {
  std::string text =
      "<?xml version=\"1.0\"?>\n"
      "<VTKFile type=\"PPolyData\" version=\"1.0\" byte_order=\"LittleEndian\" "
      "header_type=\"UInt64\">\n"
      "  <PPolyData GhostLevel=\"0\">\n";
  text += point_data_text(header);
  text +=
      "    <PPoints>\n"
      "      <PDataArray type=\"Float32\" Name=\"Points\" NumberOfComponents=\"3\"/>\n"
      "    </PPoints>\n";
  for (std::size_t run = 0; run < parts.size(); ++run)
    for (std::uint32_t number = 0; number < parts[run]; ++number)
      text += fmt::format("    <Piece Source=\"{}\"/>\n",
                          xml_escaped(output.reference(part_name(run, number, kVtpExtension))));
  return text + "  </PPolyData>\n</VTKFile>\n";
}

}  // namespace isobrick
