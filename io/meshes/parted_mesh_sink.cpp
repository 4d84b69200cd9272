#include "io/meshes/parted_mesh_sink.h"

#include <utility>

#include "io/meshes/vertex_rows.h"

namespace isobrick::inline v0 {

PartedMeshSink::PartedMeshSink(std::string path, bool force, std::uint64_t part_triangles)
    : out_(std::move(path), force),
      rows_(open_scratch_beside(out_.index().path())),
      triangles_(open_scratch_beside(out_.index().path())),
      part_triangles_(part_triangles) {}

void PartedMeshSink::write(const MeshChunk& chunk) {
  size_.vertices += chunk.positions.size();
  size_.triangles += chunk.triangles.size();
  append_rows(rows_, chunk);
  triangles_.append(std::as_bytes(chunk.triangles));
}

std::uint64_t PartedMeshSink::bytes() const {
  return rows_.size() + triangles_.size() + part_bytes_ + out_.index().writer().size();
}

void PartedMeshSink::write_parts(
    std::string_view extension,
    const std::function<void(FileWriter&, const MeshPart&)>& write_part) {
  for_each_part(triangles_, size_, part_triangles_, [&](const MeshPart& part) {
    FileWriter out = out_.create_part(extension);
    write_part(out, part);
    out.finish();
    part_bytes_ += out.size();
  });
}

void PartedMeshSink::append_whole(FileWriter& out) {
  out.append_file(rows_);
  out.append_file(triangles_);
}

void PartedMeshSink::for_each_row_run(const MeshPart& part,
                                      const std::function<void(std::span<const std::byte>)>& take) {
  isobrick::for_each_row_run({rows_, row_bytes(has_normals_, attributes_.size())}, part, take);
}

void PartedMeshSink::for_each_triangle_run(
    const MeshPart& part, const std::function<void(std::span<const Triangle>)>& take) {
  isobrick::for_each_triangle_run(triangles_, part, take);
}

}  // namespace isobrick
