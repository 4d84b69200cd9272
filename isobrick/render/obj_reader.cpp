#include <fmt/format.h>

#include <array>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <string_view>
#include <vector>

#include "isobrick/core/error.h"
#include "isobrick/io/output_file.h"
#include "isobrick/render/mesh_parts_reader.h"
#include "isobrick/render/mesh_readers.h"
#include "isobrick/render/vectors.h"

namespace isobrick {
namespace {

constexpr std::size_t kMostLine = 1 << 16;

/// Wavefront OBJ: vertices and faces of text. Positions and normals go once into
/// nameless files, which are mapped; faces are read from the text each time.
class ObjText {
 public:
  ObjText(const std::string& path, std::string_view text) : path_(path), rest_(text) {}

  /// The next line's words; false at the end. A '\' at its end is not read.
  bool next() {
    if (rest_.empty()) return false;
    const std::size_t end = std::min(rest_.find('\n'), rest_.size());
    if (end > kMostLine) fail(fmt::format("it is {} bytes long", end));
    ++number_;
    line_ = rest_.substr(0, end);
    rest_.remove_prefix(std::min(end + 1, rest_.size()));
    return true;
  }

  std::string_view word() {
    const std::size_t begin = line_.find_first_not_of(" \t\r");
    if (begin == line_.npos) return line_ = {};
    const std::size_t end = std::min(line_.find_first_of(" \t\r", begin), line_.size());
    const std::string_view found = line_.substr(begin, end - begin);
    line_.remove_prefix(end);
    return found;
  }

  /// Of the line, without leading blanks.
  std::string_view rest() const {
    return line_.substr(std::min(line_.find_first_not_of(" \t"), line_.size()));
  }

  Vec3d vector() {
    Vec3d v;
    for (int axis = 0; axis < 3; ++axis) {
      const std::string_view text = word();
      const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), v[axis]);
      if (error != std::errc() || end != text.data() + text.size())
        fail(fmt::format("'{}' is no number", text));
    }
    return v;
  }

  [[noreturn]] void fail(const std::string& what) const {
    throw Error(
        fmt::format("'{}' is no OBJ file that can be drawn: line {}: {}", path_, number_, what));
  }

 private:
  const std::string& path_;
  std::string_view rest_, line_;
  std::uint64_t number_ = 0;
};

/// Faces of the text; polygons become fans.
class ObjTriangles final : public TriangleReader {
 public:
  ObjTriangles(std::string path, std::string_view text)
      : path_(std::move(path)), text_(path_, text) {}

  bool next(std::array<std::uint64_t, 3>& triangle) override {
    while (corner_ + 1 >= corners_.size()) {
      if (!text_.next()) return false;
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

  std::string path_;
  ObjText text_;
  std::uint64_t vertices_ = 0;
  std::vector<std::uint64_t> corners_;
  std::size_t corner_ = 1;
};

std::filesystem::path temporary_folder() {
  std::error_code failure;
  std::filesystem::path folder = std::filesystem::temp_directory_path(failure);
  if (failure)
    throw Error("there is no folder for temporary files; set TMPDIR to one: " + failure.message());
  return folder;
}

/// Vectors in a nameless file. They are doubles: a float would round the coordinates of a map
/// before the picture's origin is subtracted.
class VectorFile {
 public:
  VectorFile() : out_(open_scratch_beside((temporary_folder() / "isobrick").string())) {}
  void add(Vec3d v) {
    out_.append(std::as_bytes(std::span(&v, 1)));
    ++count_;
  }
  std::uint64_t count() const { return count_; }
  std::shared_ptr<MappedFile> map() {
    out_.flush();
    const File file = out_.share();
    return std::make_shared<MappedFile>(fmt::format("/proc/self/fd/{}", file.fd()));
  }

 private:
  FileWriter out_;
  std::uint64_t count_ = 0;
};

}  // namespace

std::unique_ptr<MeshFile> read_obj(const std::string& path, std::shared_ptr<MappedFile> file) {
  const std::string_view text(reinterpret_cast<const char*>(file->bytes().data()),
                              file->bytes().size());
  VectorFile positions, normals;
  IndexedPart part;
  std::string unit;
  for (ObjText lines(path, text); lines.next();) {
    const std::string_view kind = lines.word();
    if (kind == "#" && unit.empty() && positions.count() == 0) unit = unit_of_comment(lines.rest());
    if (kind == "v") positions.add(lines.vector());
    if (kind == "vn") normals.add(lines.vector());
    if (kind != "f") continue;
    std::uint64_t corners = 0;
    while (!lines.word().empty()) ++corners;
    part.faces += corners < 3 ? 0 : corners - 2;
  }
  part.vertices = positions.count();
  std::vector<std::shared_ptr<const void>> keep{file};
  const auto field = [&keep](VectorFile& vectors) {
    const std::shared_ptr<MappedFile> mapped = vectors.map();
    keep.push_back(mapped);
    constexpr NumberKind kind = NumberKind::f64;
    return VertexField{.first = mapped->bytes().data(),
                       .stride = sizeof(Vec3d),
                       .offsets = {0, 8, 16},
                       .kinds = {kind, kind, kind}};
  };
  part.positions = field(positions);
  // A normal a vertex, as isosurfaces have it; others are lit by facet.
  if (normals.count() > 0 && normals.count() == positions.count()) part.normals = field(normals);
  part.open_triangles = [path, text] { return std::make_unique<ObjTriangles>(path, text); };
  return std::make_unique<IndexedMeshFile>(path, std::vector{std::move(part)}, std::move(keep),
                                           std::move(unit));
}

}  // namespace isobrick
