#include "io/meshes/glb_compressor.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <limits>
#include <memory>
#include <utility>

#include "io/meshes/gltf/meshopt_codec.h"

namespace isobrick::inline v0 {
namespace {

constexpr std::uint32_t kUnnamed = std::numeric_limits<std::uint32_t>::max();
/// The largest field: three floats.
constexpr std::size_t kMaxField = sizeof(Vec3f);

}  // namespace

GlbCompressor::GlbCompressor(const GlbVertices& vertices, FileWriter& out,
                             std::uint64_t max_triangles)
    : vertices_(vertices), out_(out), max_triangles_(max_triangles) {
  check_meshopt();
}

std::uint64_t GlbCompressor::max_vertices_of(std::uint64_t triangles) {
  return std::max<std::uint64_t>(triangles * 3 / 4, 3);
}

std::uint64_t GlbCompressor::memory_with(std::uint64_t max_triangles) {
  const std::uint64_t vertices = max_vertices_of(max_triangles);
  const std::uint64_t numbers = max_triangles * sizeof(std::uint32_t);
  const std::uint64_t of_triangles =
      max_triangles * sizeof(Triangle) + max_encoded_triangles(max_triangles, vertices);
  const std::uint64_t of_rows = vertices * kMaxField + max_encoded_rows(vertices, kMaxField);
  return numbers + std::max(of_triangles, of_rows) + FileWriter::kBuffer;
}

void GlbCompressor::add(const StoredMesh& mesh, const MeshPart& part) {
  numbers_.assign(static_cast<std::size_t>(part.vertices()), kUnnamed);
  triangles_.reserve(static_cast<std::size_t>(std::min(part.triangles, max_triangles_)));
  for_each_triangle_batch(mesh, part, [&](std::span<const Triangle> run) {
    for (const Triangle& triangle : run) {
      if (triangles_.size() == max_triangles_ || named_ + 3 > max_vertices())
        finish_primitive(mesh, part);
      add_triangle(triangle);
    }
  });
  if (!triangles_.empty()) finish_primitive(mesh, part);
  numbers_ = {};
}

void GlbCompressor::add_triangle(const Triangle& triangle) {
  Triangle& own = triangles_.emplace_back();
  for (std::size_t corner = 0; corner < 3; ++corner) {
    std::uint32_t& number = numbers_[triangle[corner]];
    if (number == kUnnamed) number = named_++;
    own[corner] = number;
  }
}

void GlbCompressor::finish_primitive(const StoredMesh& mesh, const MeshPart& part) {
  GlbPrimitive primitive{.vertices = named_, .triangles = triangles_.size()};
  primitive.vertex_bytes = primitive.vertices * vertices_.row_bytes();
  const BufferRange triangles = append(encode_triangles(triangles_, named_).span());
  triangles_ = {};
  for (const GlbField& field : vertices_.fields()) {
    const std::vector<std::byte> rows = field_rows(field, mesh, part);
    if (primitive.compressed.empty()) primitive.bounds = vertices_.bounds_of_positions(rows);
    primitive.compressed.push_back(append(encode_rows(rows, field.bytes).span()));
  }
  primitive.compressed.push_back(triangles);
  primitives_.push_back(std::move(primitive));
  std::fill(numbers_.begin(), numbers_.end(), kUnnamed);
  named_ = 0;
}

std::vector<std::byte> GlbCompressor::field_rows(const GlbField& field, const StoredMesh& mesh,
                                                 const MeshPart& part) const {
  std::vector<std::byte> rows(named_ * field.bytes);
  const std::size_t from_bytes = vertices_.float_row_bytes(), row_bytes = vertices_.row_bytes();
  std::unique_ptr<std::byte[]> stored;
  std::size_t stored_size = 0, vertex = 0;
  for_each_row_batch(mesh, part, [&](std::span<const std::byte> run) {
    const std::size_t count = run.size() / from_bytes;
    if (count * row_bytes > stored_size) {
      stored_size = count * row_bytes;
      stored = std::make_unique_for_overwrite<std::byte[]>(stored_size);
    }
    vertices_.store(run, stored.get());
    for (std::size_t i = 0; i < count; ++i, ++vertex)
      if (numbers_[vertex] != kUnnamed)
        std::memcpy(rows.data() + numbers_[vertex] * field.bytes,
                    stored.get() + i * row_bytes + field.offset, field.bytes);
  });
  return rows;
}

BufferRange GlbCompressor::append(std::span<const std::byte> bytes) {
  constexpr std::array<std::byte, 3> zeros{};
  const BufferRange range{out_.size(), bytes.size()};
  out_.append(bytes);
  out_.append(std::span(zeros).first((4 - bytes.size() % 4) % 4));
  return range;
}

}  // namespace isobrick
