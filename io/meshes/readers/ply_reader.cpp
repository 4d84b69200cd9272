#include <fmt/format.h>

#include <array>
#include <limits>
#include <string_view>
#include <utility>
#include <vector>

#include <isobrick/error.h>
#include "io/meshes/readers/mesh_parts_reader.h"
#include "io/meshes/readers/mesh_readers.h"
#include "io/meshes/readers/ply_header.h"

namespace isobrick::inline v0 {
namespace {

/// The field of three properties of an element without lists.
VertexField field_of(const PlyElement& element, const std::array<std::size_t, 3>& places,
                     const std::byte* first, bool swapped) {
  VertexField field{.first = first, .stride = *element.row_bytes(), .swapped = swapped};
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t before = 0; before < places[i]; ++before)
      field.offsets[i] += static_cast<std::uint32_t>(size_of(element.properties[before].kind));
    field.kinds[i] = element.properties[places[i]].kind;
  }
  return field;
}

/// Reads faces row by row; polygons become fans.
class PlyTriangles final : public TriangleReader {
 public:
  PlyTriangles(std::string path, const PlyElement& faces, std::span<const std::byte> bytes,
               bool swapped)
      : path_(std::move(path)), faces_(faces), rest_(bytes), swapped_(swapped) {}

  bool next(std::array<std::uint64_t, 3>& triangle) override {
    while (corner_ + 1 >= corners_) {
      if (row_ == faces_.count) return false;
      read_row();
      ++row_;
    }
    triangle = {vertex(0), vertex(corner_), vertex(corner_ + 1)};
    ++corner_;
    return true;
  }

 private:
  const std::byte* take(std::uint64_t size) {
    if (size > rest_.size())
      fail_ply(path_, fmt::format("it ends within face {} of {}", row_, faces_.count));
    const std::byte* at = rest_.data();
    rest_ = rest_.subspan(static_cast<std::size_t>(size));
    return at;
  }

  void read_row() {
    corners_ = 0;
    corner_ = 1;
    for (const PlyProperty& property : faces_.properties) {
      if (!property.list) {
        take(size_of(property.kind));
        continue;
      }
      const double count =
          load_number(take(size_of(property.count_kind)), property.count_kind, swapped_);
      if (!(count >= 0) || count > 1e9)
        fail_ply(path_, fmt::format("face {} has {} vertices", row_, count));
      const auto whole = static_cast<std::uint64_t>(count);
      const std::byte* at = take(whole * size_of(property.kind));
      if (property.name != "vertex_indices" && property.name != "vertex_index") continue;
      list_ = at;
      kind_ = property.kind;
      corners_ = whole;
    }
  }

  std::uint64_t vertex(std::uint64_t corner) const {
    const double number = load_number(list_ + corner * size_of(kind_), kind_, swapped_);
    // Negative ones are no vertex of any file.
    return number >= 0 && number < 0x1p53 ? static_cast<std::uint64_t>(number)
                                          : std::numeric_limits<std::uint64_t>::max();
  }

  std::string path_;
  PlyElement faces_;
  std::span<const std::byte> rest_;
  bool swapped_;
  std::uint64_t row_ = 0, corners_ = 0, corner_ = 1;
  const std::byte* list_ = nullptr;
  NumberKind kind_{};
};

/// Positions, normals and colours of the vertices, which begin at `first`.
void take_vertices(const std::string& path, const PlyElement& element, const std::byte* first,
                   bool swapped, IndexedPart& part) {
  const auto positions = element.find({"x", "y", "z"});
  if (!positions) fail_ply(path, "its vertices have no x, y, z");
  part.vertices = element.count;
  part.positions = field_of(element, *positions, first, swapped);
  if (const auto normals = element.find({"nx", "ny", "nz"}))
    part.normals = field_of(element, *normals, first, swapped);
  if (const auto colours = element.find_colours()) {
    part.colours = field_of(element, *colours, first, swapped);
    part.colours->scale = ply_colour_scale(part.colours->kinds[0]);
  }
}

}  // namespace

std::unique_ptr<MeshFile> read_ply(const std::string& path, std::shared_ptr<MappedFile> file) {
  const std::span<const std::byte> bytes = file->bytes();
  const PlyHeader header =
      parse_ply_header(path, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
  if (header.text) return read_text_ply(path, std::move(file), header);
  std::span<const std::byte> rest = bytes.subspan(header.bytes);
  IndexedPart part;
  bool vertices = false;
  for (const PlyElement& element : header.elements) {
    if (element.name == "face" && vertices) {
      element.find_corners(path);
      // Every face takes a byte at least, which also bounds what is claimed.
      if (element.count > rest.size())
        fail_ply(path, fmt::format("{} faces cannot be in {} bytes", element.count, rest.size()));
      part.faces = element.count;
      part.open_triangles = [path, element, rest, swapped = header.swapped] {
        return std::make_unique<PlyTriangles>(path, element, rest, swapped);
      };
      return std::make_unique<IndexedMeshFile>(
          path, std::vector{std::move(part)},
          std::vector<std::shared_ptr<const void>>{std::move(file)}, header.unit);
    }
    const std::optional<std::uint64_t> row = element.row_bytes();
    if (!row) fail_ply(path, fmt::format("its element '{}' has lists", element.name));
    if (*row > 0 && element.count > rest.size() / *row)
      fail_ply(path, fmt::format("{} elements '{}' of {} bytes are beyond its end", element.count,
                                 element.name, *row));
    if (element.name == "vertex") {
      take_vertices(path, element, rest.data(), header.swapped, part);
      vertices = true;
    }
    rest = rest.subspan(static_cast<std::size_t>(*row * element.count));
  }
  fail_ply(path, "it has no vertices followed by faces");
}

}  // namespace isobrick
