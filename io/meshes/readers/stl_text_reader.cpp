#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string_view>
#include <vector>

#include <isobrick/error.h>
#include "core/vectors.h"
#include "io/meshes/readers/mesh_parts_reader.h"
#include "io/meshes/readers/mesh_readers.h"
#include "io/meshes/readers/mesh_text.h"

namespace isobrick::inline v0 {
namespace {

using Corners = std::array<Vec3d, 3>;

/// STL in text, facet by facet. Words may be in capitals, as some programs write them.
class FacetReader {
 public:
  FacetReader(const std::string& path, std::string_view text) : text_(path, "STL", text) {
    expect("solid");
    text_.next_line();  // behind its name
  }

  /// The next facet's corners; false behind the last solid.
  bool next(Corners& corners) {
    std::string_view word = text_.next_word();
    while (is(word, "endsolid")) {
      text_.next_line();
      word = text_.next_word();
      if (word.empty()) return false;
      if (!is(word, "solid")) fail_at(word, "solid");
      text_.next_line();
      word = text_.next_word();
    }
    if (!is(word, "facet")) fail_at(word, "facet");
    // The corners make the normal; the stored one need not be a number.
    expect("normal");
    for (int i = 0; i < 3; ++i) text_.next_word();
    expect("outer");
    expect("loop");
    for (Vec3d& corner : corners) {
      expect("vertex");
      for (int axis = 0; axis < 3; ++axis) corner[axis] = text_.parse(text_.next_word());
    }
    expect("endloop");
    expect("endfacet");
    return true;
  }

 private:
  static bool is(std::string_view word, std::string_view keyword) {
    return std::equal(word.begin(), word.end(), keyword.begin(), keyword.end(), [](char a, char b) {
      return (a >= 'A' && a <= 'Z' ? static_cast<char>(a + 32) : a) == b;
    });
  }
  void expect(std::string_view keyword) {
    const std::string_view word = text_.next_word();
    if (!is(word, keyword)) fail_at(word, keyword);
  }
  [[noreturn]] void fail_at(std::string_view word, std::string_view keyword) const {
    text_.fail(word.empty()
                   ? fmt::format("it ends where '{}' should be", keyword)
                   : fmt::format("'{}' stands where '{}' should be", word.substr(0, 60), keyword));
  }

  MeshText text_;
};

class StlTextFile final : public MeshFile {
 public:
  StlTextFile(std::string path, std::shared_ptr<MappedFile> file)
      : path_(std::move(path)), file_(std::move(file)), bounds_(path_) {
    Corners corners;
    for (FacetReader facets = open(); facets.next(corners); ++triangles_)
      for (std::size_t k = 0; k < 3; ++k) bounds_.include(corners[k], 3 * triangles_ + k);
  }

  MeshFileInfo info() const override { return {.vertices = 3 * triangles_, .faces = triangles_}; }

  void bounds(Vec3d& lo, Vec3d& hi) const override { bounds_.get(lo, hi); }

  void read(Vec3d origin, const Take& take) const override {
    std::vector<Vec3f> positions;
    std::vector<Triangle> triangles;
    const auto flush = [&] {
      if (!triangles.empty()) take({0, positions, {}, triangles}, origin);
      positions.clear();
      triangles.clear();
    };
    Corners corners;
    for (FacetReader facets = open(); facets.next(corners);) {
      const auto vertex = static_cast<std::uint32_t>(positions.size());
      triangles.push_back({vertex, vertex + 1, vertex + 2});
      for (const Vec3d& corner : corners) positions.push_back(to_float(corner - origin));
      if (triangles.size() == kBatch) flush();
    }
    flush();
  }

 private:
  FacetReader open() const {
    const auto bytes = file_->bytes();
    return {path_, {reinterpret_cast<const char*>(bytes.data()), bytes.size()}};
  }

  std::string path_;
  std::shared_ptr<MappedFile> file_;
  std::uint64_t triangles_ = 0;
  BoundsOf bounds_;
};

}  // namespace

std::unique_ptr<MeshFile> read_text_stl(const std::string& path, std::shared_ptr<MappedFile> file) {
  return std::make_unique<StlTextFile>(path, std::move(file));
}

}  // namespace isobrick
