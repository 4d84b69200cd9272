#include "io/meshes/vtp_sink.h"

#include <fmt/format.h>

#include <cstring>
#include <filesystem>

#include <isobrick/error.h>
#include "io/bytes/xml_text.h"
#include "io/meshes/append_items.h"
#include "io/meshes/mesh_parts.h"
#include "io/meshes/vertex_rows.h"

namespace isobrick::inline v0 {
namespace {

constexpr std::string_view kPartExtension = ".vtp";

/// Refuses a name that the index could not hold, before anything is created.
std::string named_in_xml(std::string path) {
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
  return path;
}

/// Appends the bytes [first, first + kBytes) of each row.
template <std::size_t kBytes>
void append_column(FileWriter& out, std::span<const std::byte> rows, std::size_t row,
                   std::size_t first) {
  append_items<kBytes>(out, rows.size() / row, [&](std::byte* to, std::uint64_t i) {
    std::memcpy(to, rows.data() + i * row + first, kBytes);
  });
}

}  // namespace

VtpSink::VtpSink(std::string path, bool force, std::size_t memory)
    : memory_(memory),
      out_(std::move(path), force, Streaming::when_complete),
      normals_(open_scratch_beside(out_.path(), memory / 3)),
      triangles_(open_scratch_beside(out_.path(), memory - memory / 3)) {}

void VtpSink::begin(const MeshHeader& header) {
  layout_.normals = header.has_normals;
  layout_.unit = header.unit;
  layout_.attributes = header.attributes;
  for (std::size_t i = 0; i < header.attributes.size(); ++i)
    attributes_.push_back(open_scratch_beside(out_.path()));
  out_.writer().append(layout_.header());
  append_length(out_.writer(), 0);
}

void VtpSink::write(const MeshChunk& chunk) {
  layout_.size.vertices += chunk.positions.size();
  layout_.size.triangles += chunk.triangles.size();
  out_.writer().append(std::as_bytes(chunk.positions));
  normals_.append(std::as_bytes(chunk.normals));
  triangles_.append(std::as_bytes(chunk.triangles));
  for (std::size_t i = 0; i < attributes_.size(); ++i)
    attributes_[i].append(std::as_bytes(chunk.attributes[i].values));
}

std::uint64_t VtpSink::bytes() const {
  std::uint64_t bytes = out_.writer().size() + normals_.size() + triangles_.size();
  for (const FileWriter& values : attributes_) bytes += values.size();
  return bytes;
}

void VtpSink::finish() {
  FileWriter& out = out_.writer();
  const std::string header = layout_.header();
  const std::uint64_t points = layout_.point_bytes();
  out.patch(0, header);
  out.patch(header.size(), {reinterpret_cast<const char*>(&points), sizeof(points)});
  if (layout_.normals) {
    append_length(out, points);
    out.append_file(normals_);
  }
  for (FileWriter& values : attributes_) {
    append_length(out, layout_.attribute_bytes());
    out.append_file(values);
    values.release();
  }
  append_length(out, layout_.connectivity_bytes());
  if (layout_.wide()) {
    const MeshPart all{.triangles = layout_.size.triangles};
    for_each_triangle_run(triangles_, all, [&](std::span<const Triangle> run) {
      append_connectivity(out, layout_, run);
    });
  } else {
    out.append_file(triangles_);
  }
  append_vtp_end(out, layout_);
  normals_.release();
  triangles_.release();
  out_.publish();
}

PvtpSink::PvtpSink(std::string path, bool force, std::uint64_t part_triangles)
    : PartedMeshSink(named_in_xml(std::move(path)), force, part_triangles) {}

void PvtpSink::write_part(FileWriter& out, const MeshPart& part) {
  const VtpLayout layout{{part.vertices(), part.triangles}, has_normals(), unit(), attributes()};
  const std::size_t vectors = row_bytes(has_normals());
  const std::size_t row = row_bytes(has_normals(), attributes().size());
  out.append(layout.header());
  for (std::size_t column = 0; column < vectors; column += sizeof(Vec3f)) {
    append_length(out, layout.point_bytes());
    for_each_row_run(part, [&](std::span<const std::byte> run) {
      append_column<sizeof(Vec3f)>(out, run, row, column);
    });
  }
  for (std::size_t column = vectors; column < row; column += sizeof(float)) {
    append_length(out, layout.attribute_bytes());
    for_each_row_run(part, [&](std::span<const std::byte> run) {
      append_column<sizeof(float)>(out, run, row, column);
    });
  }
  append_length(out, layout.connectivity_bytes());
  for_each_triangle_run(
      part, [&](std::span<const Triangle> run) { append_connectivity(out, layout, run); });
  append_vtp_end(out, layout);
}

void PvtpSink::finish() {
  write_parts(kPartExtension,
              [this](FileWriter& out, const MeshPart& part) { write_part(out, part); });
  output().index().writer().append(index_text());
  release_scratch();
  output().publish();
}

/// The declaration of what the points of all parts have.
std::string PvtpSink::point_data_text() const {
  if (!has_normals() && attributes().empty()) return {};
  std::string text =
      has_normals()
          ? "    <PPointData Normals=\"Normals\">\n"
            "      <PDataArray type=\"Float32\" Name=\"Normals\" NumberOfComponents=\"3\"/>\n"
          : "    <PPointData>\n";
  for (const std::string& name : attributes())
    text += fmt::format(
        "      <PDataArray type=\"Float32\" Name=\"{}\" NumberOfComponents=\"1\"/>\n", name);
  return text + "    </PPointData>\n";
}

std::string PvtpSink::index_text() const {
  std::string text =
      "<?xml version=\"1.0\"?>\n"
      "<VTKFile type=\"PPolyData\" version=\"1.0\" byte_order=\"LittleEndian\" "
      "header_type=\"UInt64\">\n"
      "  <PPolyData GhostLevel=\"0\">\n";
  text += point_data_text();
  text +=
      "    <PPoints>\n"
      "      <PDataArray type=\"Float32\" Name=\"Points\" NumberOfComponents=\"3\"/>\n"
      "    </PPoints>\n";
  for (std::size_t i = 0; i < output().parts(); ++i)
    text += fmt::format("    <Piece Source=\"{}\"/>\n",
                        xml_escaped(output().reference(i, kPartExtension)));
  return text + "  </PPolyData>\n</VTKFile>\n";
}

}  // namespace isobrick
