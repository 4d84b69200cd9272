#include <isobrick/mesh.h>

#include <algorithm>
#include <vector>

#include <fmt/format.h>

#include <isobrick/error.h>
#include <isobrick/mesh_file_sink.h>
#include <isobrick/progress.h>
#include "io/meshes/mesh_writing.h"

namespace isobrick::inline v0 {
namespace {

MeshHeader header_of_mesh(const Mesh& mesh) {
  MeshHeader header;
  header.has_normals = !mesh.normals.empty();
  header.unit = mesh.unit;
  if (mesh.positions.empty()) return header;
  Vec3f lo = mesh.positions[0], hi = lo;
  for (const Vec3f& p : mesh.positions)
    for (int axis = 0; axis < 3; ++axis) {
      lo[axis] = std::min(lo[axis], p[axis]);
      hi[axis] = std::max(hi[axis], p[axis]);
    }
  header.world_lo = {double{lo.x}, double{lo.y}, double{lo.z}};
  header.world_hi = {double{hi.x}, double{hi.y}, double{hi.z}};
  header.surface = MeshBounds{header.world_lo, header.world_hi};
  return header;
}

/// Elements between two reports of progress.
constexpr std::size_t kPart = std::size_t{1} << 20;

/// Calls f(begin, count) for the parts of `size` elements of `bytes` each.
template <class F>
void for_each_part(std::size_t size, std::size_t bytes, Progress& progress, F&& f) {
  for (std::size_t i = 0; i < size; i += kPart) {
    const std::size_t count = std::min(kPart, size - i);
    f(i, count);
    progress.advance(count * bytes);
  }
}

using Attributes = std::span<const VertexAttribute>;

/// Those of vertices [begin, begin + count).
std::vector<VertexAttribute> part_of(Attributes attributes, std::size_t begin, std::size_t count) {
  std::vector<VertexAttribute> part;
  for (const VertexAttribute& attribute : attributes)
    part.push_back({attribute.name, attribute.values.subspan(begin, count)});
  return part;
}

/// Vertices first, so that triangles may name any of them.
void write_welded(const Mesh& mesh, Attributes attributes, MeshSink& sink, Progress& progress) {
  for_each_part(
      mesh.positions.size(), sizeof(Vec3f), progress, [&](std::size_t i, std::size_t count) {
        MeshChunk chunk{.first_vertex = i, .positions = mesh.positions.span().subspan(i, count)};
        if (!mesh.normals.empty()) chunk.normals = mesh.normals.span().subspan(i, count);
        const std::vector<VertexAttribute> of_chunk = part_of(attributes, i, count);
        chunk.attributes = of_chunk;
        sink.write(chunk);
      });
  const std::vector<VertexAttribute> none = part_of(attributes, 0, 0);
  for_each_part(mesh.triangles.size(), sizeof(Triangle), progress,
                [&](std::size_t i, std::size_t count) {
                  sink.write({.first_vertex = mesh.positions.size(),
                              .triangles = mesh.triangles.span().subspan(i, count),
                              .attributes = none});
                });
}

/// Each chunk has all vertices.
void write_unwelded(const Mesh& mesh, MeshSink& sink, Progress& progress) {
  for_each_part(mesh.triangles.size(), sizeof(Triangle), progress,
                [&](std::size_t i, std::size_t count) {
                  MeshChunk chunk = mesh.chunk();
                  chunk.triangles = chunk.triangles.subspan(i, count);
                  sink.write(chunk);
                });
}

void check_attributes(const Mesh& mesh, Attributes attributes, const std::filesystem::path& path,
                      const MeshFileOptions& options) {
  for (const VertexAttribute& attribute : attributes)
    if (attribute.values.size() != mesh.positions.size())
      throw UsageError(fmt::format("the attribute '{}' has {} values, and the mesh {} vertices",
                                   attribute.name, attribute.values.size(), mesh.positions.size()));
  const auto format = options.format ? options.format : find_mesh_format(path.extension().string());
  if (!attributes.empty() && format && !has_attributes(*format))
    throw UsageError(fmt::format(
        "{} cannot hold attributes of vertices; choose PLY, VTP, PVTP or GLB", name_of(*format)));
}

}  // namespace

void write_mesh(const Mesh& mesh, std::span<const VertexAttribute> attributes, MeshSink& sink,
                Progress& progress) {
  const bool is_welded = sink.indexing() == Indexing::welded;
  progress.begin("saving", mesh.triangles.size() * sizeof(Triangle) +
                               (is_welded ? mesh.positions.size() * sizeof(Vec3f) : 0));
  MeshHeader header = header_of_mesh(mesh);
  for (const VertexAttribute& attribute : attributes)
    header.attributes.emplace_back(attribute.name);
  sink.begin(header);
  if (is_welded)
    write_welded(mesh, attributes, sink, progress);
  else
    write_unwelded(mesh, sink, progress);
  progress.end();
  sink.finish();
}

void Mesh::save(const std::filesystem::path& path) const { save(path, {}); }

void Mesh::save(const std::filesystem::path& path, const MeshFileOptions& options) const {
  save(path, options, no_progress());
}

void Mesh::save(const std::filesystem::path& path, const MeshFileOptions& options,
                Progress& progress) const {
  save(path, options, progress, {});
}

void Mesh::save(const std::filesystem::path& path, const MeshFileOptions& options,
                Progress& progress, std::span<const VertexAttribute> attributes) const {
  check_attributes(*this, attributes, path, options);
  MeshFileOptions heard = options;
  if (!heard.progress) heard.progress = &progress;
  write_mesh(*this, attributes, *create_mesh_file(path, heard), progress);
}

}  // namespace isobrick
