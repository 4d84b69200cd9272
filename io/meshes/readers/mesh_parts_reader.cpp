#include "io/meshes/readers/mesh_parts_reader.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>

#include <isobrick/error.h>
#include "core/box_union.h"
#include "core/length_unit.h"
#include "core/vectors.h"
#include "io/bytes/byte_order.h"
#include "io/bytes/mapped_file.h"

namespace isobrick::inline v0 {
namespace {

template <class T>
double load(const std::byte* at, bool swapped) {
  std::array<std::byte, sizeof(T)> bytes;
  std::memcpy(bytes.data(), at, sizeof(T));
  if (swapped) swap_byte_order(bytes.data(), 1, sizeof(T));
  T value;
  std::memcpy(&value, bytes.data(), sizeof(T));
  return static_cast<double>(value);
}

VertexColour to_colour(Vec3d rgb, bool linear) {
  VertexColour colour{0, 0, 0, 255};
  for (int channel = 0; channel < 3; ++channel) {
    // What is no number is black.
    double value = rgb[channel] > 0 ? std::min(rgb[channel], 1.0) : 0;
    if (linear)
      value = value <= 0.0031308 ? 12.92 * value : 1.055 * std::pow(value, 1 / 2.4) - 0.055;
    colour[static_cast<std::size_t>(channel)] = static_cast<std::uint8_t>(std::lround(255 * value));
  }
  return colour;
}
/// About what a vertex has in a file.
constexpr std::size_t kBytesOfVertex = 64;

/// Gathers the vertices of a batch of triangles. A vertex that is named again soon is
/// found again, so that batches are little larger than what they are made from.
class Batch {
 public:
  Batch(const IndexedPart& part, Vec3d origin, const MeshFile::Take& take)
      : part_(part),
        to_world_of_normals_(part.to_world.of_normals()),
        origin_(origin),
        take_(take),
        recent_(kRecent) {}

  void add(const std::array<std::uint64_t, 3>& triangle) {
    MappedFile::note_read(sizeof(triangle));
    triangles_.push_back({number_of(triangle[0]), number_of(triangle[1]), number_of(triangle[2])});
    if (triangles_.size() == MeshFile::kBatch) flush();
  }

  void flush() {
    if (triangles_.empty()) return;
    take_({0, positions_, normals_, triangles_, colours_}, origin_);
    positions_.clear();
    normals_.clear();
    colours_.clear();
    triangles_.clear();
    std::fill(recent_.begin(), recent_.end(), RecentVertex{});
  }

 private:
  static constexpr std::size_t kRecent = 1 << 16;
  /// Bytes that the system maps with a vertex, where none of the others is near it: up to four
  /// times as many with each array.
  static constexpr std::size_t kPagesOfVertex = std::size_t{1} << 14;
  struct RecentVertex {
    std::uint64_t vertex = ~std::uint64_t{0};
    std::uint32_t number = 0;
  };

  std::uint32_t number_of(std::uint64_t vertex) {
    RecentVertex& recent = recent_[vertex % kRecent];
    if (recent.vertex != vertex) {
      MappedFile::note_read(kPagesOfVertex);
      recent = {vertex, static_cast<std::uint32_t>(positions_.size())};
      const Vec3d p = part_.to_world.move(part_.positions.at(vertex));
      positions_.push_back(to_float(p - origin_));
      if (part_.normals)
        normals_.push_back(to_float(to_world_of_normals_.turn(part_.normals->at(vertex))));
      if (part_.colours)
        colours_.push_back(to_colour(part_.colours->at(vertex), part_.linear_colours));
    }
    return recent.number;
  }

  const IndexedPart& part_;
  WorldMatrix to_world_of_normals_;
  Vec3d origin_;
  const MeshFile::Take& take_;
  std::vector<RecentVertex> recent_;
  std::vector<Vec3f> positions_, normals_;
  std::vector<VertexColour> colours_;
  std::vector<Triangle> triangles_;
};

}  // namespace

std::size_t size_of(NumberKind kind) {
  constexpr std::array<std::size_t, 10> sizes{1, 1, 2, 2, 4, 4, 8, 8, 4, 8};
  return sizes[static_cast<std::size_t>(kind)];
}

double load_number(const std::byte* at, NumberKind kind, bool swapped) {
  switch (kind) {
    case NumberKind::i8: return load<std::int8_t>(at, swapped);
    case NumberKind::u8: return load<std::uint8_t>(at, swapped);
    case NumberKind::i16: return load<std::int16_t>(at, swapped);
    case NumberKind::u16: return load<std::uint16_t>(at, swapped);
    case NumberKind::i32: return load<std::int32_t>(at, swapped);
    case NumberKind::u32: return load<std::uint32_t>(at, swapped);
    case NumberKind::i64: return load<std::int64_t>(at, swapped);
    case NumberKind::u64: return load<std::uint64_t>(at, swapped);
    case NumberKind::f32: return load<float>(at, swapped);
    case NumberKind::f64: return load<double>(at, swapped);
  }
  return 0;
}

Vec3d VertexField::at(std::uint64_t vertex) const {
  const std::byte* row = first + vertex * stride;
  Vec3d v;
  for (int axis = 0; axis < 3; ++axis) {
    const auto i = static_cast<std::size_t>(axis);
    v[axis] = load_number(row + offsets[i], kinds[i], swapped) * scale;
  }
  return v;
}

std::string unit_of_comment(std::string_view comment) {
  constexpr std::string_view keyword = "unit ";
  while (!comment.empty() && (comment.back() == '\r' || comment.back() == ' '))
    comment.remove_suffix(1);
  return comment.starts_with(keyword) ? unit_name(comment.substr(keyword.size())) : std::string();
}

void BoundsOf::include(Vec3d p, std::uint64_t vertex) {
  MappedFile::note_read(kBytesOfVertex);
  if (!std::isfinite(p.x + p.y + p.z))
    throw Error(
        fmt::format("'{}' is damaged: vertex {} is at ({}, {}, {})", path_, vertex, p.x, p.y, p.z));
  if (!std::exchange(any_, true)) lo_ = hi_ = p;
  widen(lo_, hi_, p, p);
}

void BoundsOf::get(Vec3d& lo, Vec3d& hi) const {
  lo = lo_;
  hi = hi_;
}

IndexedMeshFile::IndexedMeshFile(std::string path, std::vector<IndexedPart> parts,
                                 std::vector<std::shared_ptr<const void>> keep, std::string unit)
    : path_(std::move(path)),
      parts_(std::move(parts)),
      keep_(std::move(keep)),
      unit_(std::move(unit)) {}

MeshFileInfo IndexedMeshFile::info() const {
  MeshFileInfo info{.unit = unit_};
  for (const IndexedPart& part : parts_) {
    info.vertices += part.vertices;
    info.faces += part.faces;
  }
  return info;
}

void IndexedMeshFile::bounds(Vec3d& lo, Vec3d& hi) const {
  BoundsOf bounds(path_);
  for (const IndexedPart& part : parts_)
    for (std::uint64_t i = 0; i < part.vertices; ++i)
      bounds.include(part.to_world.move(part.positions.at(i)), i);
  bounds.get(lo, hi);
}

void IndexedMeshFile::read(Vec3d origin, const Take& take) const {
  for (const IndexedPart& part : parts_) {
    Batch batch(part, origin, take);
    const std::unique_ptr<TriangleReader> triangles = part.open_triangles();
    std::array<std::uint64_t, 3> triangle{};
    for (std::uint64_t i = 0; triangles->next(triangle); ++i) {
      for (const std::uint64_t vertex : triangle)
        if (vertex >= part.vertices)
          throw Error(fmt::format("'{}' is damaged: triangle {} names vertex {} of {}", path_, i,
                                  vertex, part.vertices));
      batch.add(triangle);
    }
    batch.flush();
  }
}

}  // namespace isobrick
