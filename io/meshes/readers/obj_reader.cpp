#include <fmt/format.h>

#include <array>
#include <charconv>
#include <optional>
#include <string_view>
#include <vector>

#include <isobrick/error.h>
#include "io/meshes/readers/mesh_parts_reader.h"
#include "io/meshes/readers/mesh_readers.h"
#include "io/meshes/readers/mesh_text.h"
#include "io/meshes/readers/scratch_rows.h"

namespace isobrick::inline v0 {
namespace {

/// Faces of the text; polygons become fans.
class ObjTriangles final : public TriangleReader {
 public:
  ObjTriangles(const std::string& path, std::string_view text) : text_(path, "OBJ", text) {}

  bool next(std::array<std::uint64_t, 3>& triangle) override {
    while (corner_ + 1 >= corners_.size()) {
      if (!text_.next_line()) return false;
      const std::string_view kind = text_.word();
      vertices_ += kind == "v";
      if (kind == "f") read_corners();
    }
    triangle = {corners_[0], corners_[corner_], corners_[corner_ + 1]};
    ++corner_;
    return true;
  }

 private:
  void read_corners() {
    corners_.clear();
    corner_ = 1;
    for (std::string_view word = text_.word(); !word.empty(); word = text_.word()) {
      std::int64_t vertex = 0;
      const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), vertex);
      const bool ends = end == word.data() + word.size() || *end == '/';
      if (error != std::errc() || !ends || vertex == 0)
        text_.fail(fmt::format("'{}' names no vertex", word));
      // They count from 1, or back from the last; beyond either end is found out later.
      corners_.push_back(vertex > 0 ? static_cast<std::uint64_t>(vertex) - 1
                                    : vertices_ + static_cast<std::uint64_t>(vertex));
    }
    if (corners_.size() < 3)
      text_.fail(fmt::format("a face of {} corners is none", corners_.size()));
  }

  MeshText text_;
  std::uint64_t vertices_ = 0;
  std::vector<std::uint64_t> corners_;
  std::size_t corner_ = 1;
};

/// Three more numbers of the line; nothing where there are fewer.
std::optional<Vec3d> colour_of(MeshText& line) {
  Vec3d colour;
  for (int channel = 0; channel < 3; ++channel) {
    const std::string_view word = line.word();
    if (word.empty()) return std::nullopt;
    colour[channel] = line.parse(word);
  }
  return colour;
}

}  // namespace

/// Positions and normals go once into nameless files, which are mapped; faces are read from the
/// text each time.
std::unique_ptr<MeshFile> read_obj(const std::string& path, std::shared_ptr<MappedFile> file) {
  const std::string_view text(reinterpret_cast<const char*>(file->bytes().data()),
                              file->bytes().size());
  ScratchRows positions, normals, colours;
  IndexedPart part;
  std::string unit;
  for (MeshText lines(path, "OBJ", text); lines.next_line();) {
    const std::string_view kind = lines.word();
    if (kind == "#" && unit.empty() && positions.count() == 0)
      unit = unit_of_comment(lines.rest_of_line());
    if (kind == "v") {
      positions.add(lines.vector());
      // Many programs write a colour behind a position; a lone number there is a weight.
      if (const auto colour = colour_of(lines)) colours.add(*colour);
    }
    if (kind == "vn") normals.add(lines.vector());
    if (kind != "f") continue;
    std::uint64_t corners = 0;
    while (!lines.word().empty()) ++corners;
    part.faces += corners < 3 ? 0 : corners - 2;
  }
  part.vertices = positions.count();
  std::vector<std::shared_ptr<const void>> keep{file};
  part.positions = positions.field(keep);
  // A normal a vertex, as isosurfaces have it; others are lit by facet.
  if (normals.count() > 0 && normals.count() == positions.count())
    part.normals = normals.field(keep);
  if (colours.count() > 0 && colours.count() == positions.count())
    part.colours = colours.field(keep);
  part.open_triangles = [path, text] { return std::make_unique<ObjTriangles>(path, text); };
  return std::make_unique<IndexedMeshFile>(path, std::vector{std::move(part)}, std::move(keep),
                                           std::move(unit));
}

}  // namespace isobrick
