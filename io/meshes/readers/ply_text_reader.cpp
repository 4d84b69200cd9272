#include <fmt/format.h>

#include <cmath>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include <isobrick/error.h>
#include "io/meshes/readers/mesh_parts_reader.h"
#include "io/meshes/readers/mesh_text.h"
#include "io/meshes/readers/ply_header.h"
#include "io/meshes/readers/scratch_rows.h"

namespace isobrick::inline v0 {
namespace {

/// Reads the elements of a PLY file one after the other.
class PlyRows {
 public:
  PlyRows(const std::string& path, std::string_view body, std::uint64_t lines)
      : text_(path, "PLY", body, lines) {}

  /// The next row of an element: its numbers (0 for a list), and the items of the list at `list`.
  void next(const PlyElement& element, std::size_t list, std::vector<double>& numbers,
            std::vector<std::uint64_t>& items) {
    numbers.assign(element.properties.size(), 0);
    items.clear();
    for (std::size_t i = 0; i < numbers.size(); ++i) {
      if (!element.properties[i].list) {
        numbers[i] = number(element);
        continue;
      }
      for (std::uint64_t left = list_length(element); left > 0; --left) {
        const double item = number(element);
        if (i == list) items.push_back(vertex_of(item));
      }
    }
  }

  std::size_t bytes_left() const { return text_.bytes_left(); }

 private:
  double number(const PlyElement& element) {
    const std::string_view word = text_.next_word();
    if (word.empty()) text_.fail(fmt::format("it ends within an element '{}'", element.name));
    return text_.parse(word);
  }
  std::uint64_t list_length(const PlyElement& element) {
    const double length = number(element);
    // Every item takes two bytes at least, on this line or behind it.
    if (!(length >= 0) || length != std::floor(length) || length > 1e9)
      text_.fail(fmt::format("a list has {} items", length));
    return static_cast<std::uint64_t>(length);
  }
  /// Negative numbers and fractions are no vertex of any file.
  static std::uint64_t vertex_of(double number) {
    return number >= 0 && number < 0x1p53 && number == std::floor(number)
               ? static_cast<std::uint64_t>(number)
               : std::numeric_limits<std::uint64_t>::max();
  }

  MeshText text_;
};

/// Faces of the text; polygons become fans.
class PlyTextTriangles final : public TriangleReader {
 public:
  PlyTextTriangles(PlyRows rows, PlyElement faces, std::size_t list)
      : rows_(std::move(rows)), faces_(std::move(faces)), list_(list) {}

  bool next(std::array<std::uint64_t, 3>& triangle) override {
    while (corner_ + 1 >= corners_.size()) {
      if (row_ == faces_.count) return false;
      rows_.next(faces_, list_, numbers_, corners_);
      ++row_;
      corner_ = 1;
    }
    triangle = {corners_[0], corners_[corner_], corners_[corner_ + 1]};
    ++corner_;
    return true;
  }

 private:
  PlyRows rows_;
  PlyElement faces_;
  std::size_t list_;
  std::vector<double> numbers_;
  std::vector<std::uint64_t> corners_;
  std::uint64_t row_ = 0;
  std::size_t corner_ = 1;
};

/// The vertices, read once into nameless files.
class PlyTextVertices {
 public:
  PlyTextVertices(const std::string& path, const PlyElement& element, PlyRows& rows) {
    const auto positions = element.find({"x", "y", "z"});
    if (!positions) fail_ply(path, "its vertices have no x, y, z");
    const auto normals = element.find({"nx", "ny", "nz"});
    if (normals) normals_.emplace();
    const auto colours = element.find_colours();
    if (colours) {
      colours_.emplace();
      colour_scale_ = ply_colour_scale(element.properties[(*colours)[0]].kind);
    }
    std::vector<double> numbers;
    std::vector<std::uint64_t> none;
    const auto three = [&](const std::array<std::size_t, 3>& at) {
      return Vec3d{numbers[at[0]], numbers[at[1]], numbers[at[2]]};
    };
    for (std::uint64_t i = 0; i < element.count; ++i) {
      rows.next(element, element.properties.size(), numbers, none);
      positions_.add(three(*positions));
      if (normals) normals_->add(three(*normals));
      if (colours) colours_->add(three(*colours));
    }
  }

  IndexedPart part(std::vector<std::shared_ptr<const void>>& keep) {
    IndexedPart part{.vertices = positions_.count(), .positions = positions_.field(keep)};
    if (normals_) part.normals = normals_->field(keep);
    if (colours_) part.colours = colours_->field(keep, colour_scale_);
    return part;
  }

 private:
  ScratchRows positions_;
  std::optional<ScratchRows> normals_, colours_;
  double colour_scale_ = 1;
};

}  // namespace

std::unique_ptr<MeshFile> read_text_ply(const std::string& path, std::shared_ptr<MappedFile> file,
                                        const PlyHeader& header) {
  const std::string_view text(reinterpret_cast<const char*>(file->bytes().data()),
                              file->bytes().size());
  PlyRows rows(path, text.substr(header.bytes), header.lines);
  std::vector<std::shared_ptr<const void>> keep{file};
  std::optional<IndexedPart> part;
  for (const PlyElement& element : header.elements) {
    if (element.name == "face" && part) {
      const std::size_t list = element.find_corners(path);
      if (element.count > rows.bytes_left())
        fail_ply(path,
                 fmt::format("{} faces cannot be in {} bytes", element.count, rows.bytes_left()));
      part->faces = element.count;
      part->open_triangles = [rows, element, list] {
        return std::make_unique<PlyTextTriangles>(rows, element, list);
      };
      return std::make_unique<IndexedMeshFile>(path, std::vector{std::move(*part)}, std::move(keep),
                                               header.unit);
    }
    if (element.name == "vertex") {
      part = PlyTextVertices(path, element, rows).part(keep);
    } else {
      std::vector<double> numbers;
      std::vector<std::uint64_t> none;
      for (std::uint64_t i = element.properties.empty() ? element.count : 0; i < element.count; ++i)
        rows.next(element, element.properties.size(), numbers, none);
    }
  }
  fail_ply(path, "it has no vertices followed by faces");
}

}  // namespace isobrick
