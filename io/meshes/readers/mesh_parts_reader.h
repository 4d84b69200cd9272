#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <isobrick/vec.h>
#include "io/meshes/readers/mesh_file.h"

namespace isobrick::inline v0 {

/// How a number lies in a file.
enum class NumberKind : std::uint8_t { i8, u8, i16, u16, i32, u32, i64, u64, f32, f64 };

std::size_t size_of(NumberKind kind);
/// The number at `at`; `swapped`: its bytes are in the other order.
double load_number(const std::byte* at, NumberKind kind, bool swapped);

/// Three numbers of each vertex in mapped memory.
struct VertexField {
  const std::byte* first = nullptr;
  std::uint64_t stride = 0;
  std::array<std::uint32_t, 3> offsets{};
  std::array<NumberKind, 3> kinds{NumberKind::f32, NumberKind::f32, NumberKind::f32};
  bool swapped = false;
  double scale = 1;  ///< of normalised whole numbers

  Vec3d at(std::uint64_t vertex) const;
};

/// Triangles one after the other.
class TriangleReader {
 public:
  virtual ~TriangleReader() = default;
  /// The next three vertices; false at the end.
  virtual bool next(std::array<std::uint64_t, 3>& triangle) = 0;
};

/// An affine map: the columns, then the translation.
struct WorldMatrix {
  std::array<Vec3d, 4> columns{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0, 0, 0}}};

  Vec3d turn(Vec3d v) const { return columns[0] * v.x + columns[1] * v.y + columns[2] * v.z; }
  Vec3d move(Vec3d p) const { return turn(p) + columns[3]; }
  /// The matrix of normals, which stay across the surface where axes are scaled differently:
  /// the inverse, transposed, but for a positive factor.
  WorldMatrix of_normals() const {
    const Vec3d yz = cross(columns[1], columns[2]);
    const double side = dot(columns[0], yz) < 0 ? -1 : 1;
    return {{yz * side, cross(columns[2], columns[0]) * side, cross(columns[0], columns[1]) * side,
             Vec3d{}}};
  }
};

/// Vertices and the triangles between them.
struct IndexedPart {
  std::uint64_t vertices = 0, faces = 0;
  VertexField positions;
  std::optional<VertexField> normals = {};
  std::optional<VertexField> colours = {};  ///< red, green and blue in [0, 1]
  bool linear_colours = false;              ///< as light adds up, and not sRGB
  WorldMatrix to_world;
  std::function<std::unique_ptr<TriangleReader>()> open_triangles;
};

/// A file of indexed parts, whatever its format; the formats' readers make it.
class IndexedMeshFile final : public MeshFile {
 public:
  /// `keep`: what the parts point into. `path` is for messages.
  IndexedMeshFile(std::string path, std::vector<IndexedPart> parts,
                  std::vector<std::shared_ptr<const void>> keep, std::string unit);

  MeshFileInfo info() const override;
  void bounds(Vec3d& lo, Vec3d& hi) const override;
  void read(Vec3d origin, const Take& take) const override;

 private:
  std::string path_;
  std::vector<IndexedPart> parts_;
  std::vector<std::shared_ptr<const void>> keep_;
  std::string unit_;
};

/// The unit that a comment of Isobrick names ("unit micrometer"); empty where it is another
/// comment.
std::string unit_of_comment(std::string_view comment);

/// Grows bounds by a position; throws Error for one that is not finite.
class BoundsOf {
 public:
  explicit BoundsOf(const std::string& path) : path_(path) {}
  void include(Vec3d p, std::uint64_t vertex);
  void get(Vec3d& lo, Vec3d& hi) const;

 private:
  const std::string& path_;
  Vec3d lo_, hi_;
  bool any_ = false;
};

}  // namespace isobrick
