#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include <isobrick/error.h>
#include "core/length_unit.h"
#include "io/meshes/readers/mesh_parts_reader.h"
#include "io/meshes/readers/mesh_readers.h"
#include "io/meshes/readers/vtp_arrays.h"
#include "io/meshes/readers/vtp_header.h"

namespace isobrick::inline v0 {
namespace {

/// Polygons by the ends of their runs of corners; they become fans.
class VtpTriangles final : public TriangleReader {
 public:
  VtpTriangles(std::string path, const NumberArray& corners, const NumberArray& ends,
               std::uint64_t polygons)
      : path_(std::move(path)), corners_(corners), ends_(ends), polygons_(polygons) {}

  bool next(std::array<std::uint64_t, 3>& triangle) override {
    while (corner_ + 1 >= end_) {
      if (polygon_ == polygons_) return false;
      first_ = end_;
      end_ = whole(ends_.at(polygon_));
      if (end_ < first_ || end_ > corners_.count)
        fail_vtp(path_,
                 fmt::format("polygon {} ends at corner {} of {}", polygon_, end_, corners_.count));
      corner_ = first_ + 1;
      ++polygon_;
    }
    triangle = {whole(corners_.at(first_)), whole(corners_.at(corner_)),
                whole(corners_.at(corner_ + 1))};
    ++corner_;
    return true;
  }

 private:
  /// Negative numbers are no vertex of any file.
  static std::uint64_t whole(double number) {
    return number >= 0 && number < 0x1p53 ? static_cast<std::uint64_t>(number)
                                          : std::numeric_limits<std::uint64_t>::max();
  }

  std::string path_;
  NumberArray corners_, ends_;
  std::uint64_t polygons_, polygon_ = 0, first_ = 0, end_ = 0, corner_ = 1;
};

/// Gathers the pieces of a file, or of its parts.
class VtpReader {
 public:
  std::unique_ptr<MeshFile> read(const std::string& path, std::shared_ptr<MappedFile> file) {
    const VtkFile vtk = vtp_file(path, file->bytes());
    const VtpHeader header = parse_vtp_header(vtk);
    if (header.vtk.file.get("type") == "PolyData") {
      add_file(vtk, header, std::move(file));
    } else {
      for (const std::string& source : header.sources) add_part(path, source);
    }
    return std::make_unique<IndexedMeshFile>(path, std::move(parts_), std::move(keep_), unit_);
  }

 private:
  void add_part(const std::string& index, const std::string& source) {
    const std::filesystem::path name = source;
    if (name.is_absolute() || std::find(name.begin(), name.end(), "..") != name.end())
      fail_vtp(index, fmt::format("its part '{}' is not below its folder", source));
    const std::string path = (std::filesystem::path(index).parent_path() / name).string();
    auto file = std::make_shared<MappedFile>(path);
    const VtkFile vtk = vtp_file(path, file->bytes());
    const VtpHeader header = parse_vtp_header(vtk);
    if (header.vtk.file.get("type") != "PolyData") vtk.fail("it is an index, and no part");
    add_file(vtk, header, std::move(file));
  }

  void add_file(const VtkFile& vtk, const VtpHeader& header, std::shared_ptr<MappedFile> file) {
    constexpr std::size_t kMaxUnit = 64;
    const VtpArrays arrays(vtk, file->bytes(), header.vtk, keep_);
    if (header.unit && unit_.empty()) unit_ = unit_name(arrays.text(*header.unit, kMaxUnit));
    for (const VtpPiece& piece : header.pieces) add_piece(vtk.path, piece, arrays);
    keep_.push_back(std::move(file));
  }

  void add_piece(const std::string& path, const VtpPiece& piece, const VtpArrays& arrays) {
    if (piece.strips > 0) fail_vtp(path, "it has triangle strips, which are not read");
    if (piece.polygons == 0) return;
    if (piece.positions.empty()) fail_vtp(path, "a piece has no points");
    IndexedPart part{.vertices = piece.points, .faces = piece.polygons};
    part.positions = vectors(path, piece, piece.positions.front(), arrays);
    const std::string& normals = piece.normals.empty() ? "Normals" : piece.normals;
    for (const VtkElement& array : piece.point_data)
      if (array.get("Name") == normals && array.get("NumberOfComponents") == "3")
        part.normals = vectors(path, piece, array, arrays);
    for (const VtkElement& array : piece.point_data)
      if (is_colour(piece, array)) {
        part.colours = vectors(path, piece, array, arrays);
        part.colours->scale = 1.0 / 255;
      }
    const NumberArray corners = named(path, piece, "connectivity", arrays),
                      ends = named(path, piece, "offsets", arrays);
    if (ends.count < piece.polygons)
      fail_vtp(path, fmt::format("{} polygons have {} offsets", piece.polygons, ends.count));
    part.open_triangles = [path, corners, ends, count = piece.polygons] {
      return std::make_unique<VtpTriangles>(path, corners, ends, count);
    };
    parts_.push_back(std::move(part));
  }

  /// Bytes of red, green, blue and perhaps alpha that are the scalars, which VTK shows as they are.
  static bool is_colour(const VtpPiece& piece, const VtkElement& array) {
    return array.get("type") == "UInt8" && components_of(array) >= 3 && !piece.scalars.empty() &&
           array.get("Name") == piece.scalars;
  }
  /// Of an item, 3 or 4; 0 for others.
  static std::uint32_t components_of(const VtkElement& array) {
    const std::string number = array.get("NumberOfComponents", "1");
    return number == "3" ? 3 : number == "4" ? 4 : 0;
  }

  static VertexField vectors(const std::string& path, const VtpPiece& piece,
                             const VtkElement& array, const VtpArrays& arrays) {
    const NumberArray numbers = arrays.numbers(array);
    const std::uint32_t components = std::max(components_of(array), 3u);
    if (numbers.count / components < piece.points)
      fail_vtp(path, fmt::format("{} points have {} numbers in '{}'", piece.points, numbers.count,
                                 array.get("Name")));
    const auto size = static_cast<std::uint32_t>(size_of(numbers.kind));
    return {.first = numbers.first,
            .stride = components * size,
            .offsets = {0, size, 2 * size},
            .kinds = {numbers.kind, numbers.kind, numbers.kind},
            .swapped = numbers.swapped};
  }

  static NumberArray named(const std::string& path, const VtpPiece& piece, const std::string& name,
                           const VtpArrays& arrays) {
    for (const VtkElement& array : piece.polygon_arrays)
      if (array.get("Name") == name) return arrays.numbers(array);
    fail_vtp(path, fmt::format("its polygons have no {}", name));
  }

  std::vector<IndexedPart> parts_;
  std::vector<std::shared_ptr<const void>> keep_;
  std::string unit_;
};

}  // namespace

std::unique_ptr<MeshFile> read_vtp(const std::string& path, std::shared_ptr<MappedFile> file) {
  return VtpReader().read(path, std::move(file));
}

}  // namespace isobrick
