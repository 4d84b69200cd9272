#include "io/meshes/parted_mesh_sink.h"

#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <atomic>
#include <utility>

#include "io/bytes/leftovers.h"
#include "io/meshes/vertex_rows.h"

namespace isobrick::inline v0 {

PartedMeshSink::PartedMeshSink(std::string path, bool force, std::uint64_t part_triangles)
    : out_(std::move(path), force),
      rows_(open_scratch_beside(out_.index().path())),
      triangles_(open_scratch_beside(out_.index().path())),
      part_triangles_(part_triangles),
      runs_(part_triangles) {
  stored_.rows = [this](std::uint64_t offset, std::span<std::byte> bytes) {
    rows_.read_back(offset, bytes);
  };
  stored_.triangles = [this](std::uint64_t offset, std::span<std::byte> bytes) {
    triangles_.read_back(offset, bytes);
  };
}

void PartedMeshSink::begin(const MeshHeader& header) {
  has_normals_ = header.has_normals;
  unit_ = header.unit;
  attributes_ = header.attributes;
  stored_.row_bytes = row_bytes(has_normals_, attributes_.size());
  stored_.wide = header.wide;
}

void PartedMeshSink::write(const MeshChunk& chunk) {
  append_rows(rows_, chunk, colour_bytes_);
  size_.vertices += chunk.positions.size();
  const auto add = [&](auto triangles) {
    runs_.add(size_.triangles, triangles);
    triangles_.append(std::as_bytes(triangles));
    size_.triangles += triangles.size();
  };
  if (stored_.wide)
    add(chunk.wide_triangles);
  else
    add(chunk.triangles);
}

std::uint64_t PartedMeshSink::bytes() const {
  return rows_.size() + triangles_.size() + part_bytes_ + out_.index().writer().size();
}

void PartedMeshSink::for_each_part(const std::function<void(const MeshPart&)>& take) {
  const std::vector<MeshRun> runs = runs_.runs(size_);
  for (std::size_t i = 0; i < runs.size(); ++i)
    isobrick::for_each_part(stored_, i, runs[i], part_triangles_, take);
}

std::vector<std::uint32_t> PartedMeshSink::write_parts(
    std::string_view extension, int threads,
    const std::function<void(FileWriter&, const StoredMesh&, const MeshPart&)>& write_part) {
  // As files, which several threads may read.
  rows_.flush();
  triangles_.flush();
  const File rows = rows_.share(), triangles = triangles_.share();
  StoredMesh mesh = stored_;
  mesh.rows = [&](std::uint64_t offset, std::span<std::byte> bytes) {
    rows.read_at(offset, bytes);
  };
  mesh.triangles = [&](std::uint64_t offset, std::span<std::byte> bytes) {
    triangles.read_at(offset, bytes);
  };
  const std::vector<MeshRun> runs = runs_.runs(size_);
  std::vector<std::uint32_t> parts(runs.size());
  std::atomic<std::uint64_t> written = 0;
  out_.parts_folder();
  const auto write_run = [&](std::size_t i) {
    isobrick::for_each_part(mesh, i, runs[i], part_triangles_, [&](const MeshPart& part) {
      FileWriter out = out_.create_part(part_name(part.run, part.number, extension));
      write_part(out, mesh, part);
      out.finish();
      written += out.size();
      ++parts[i];
    });
  };
  if (threads == 1)
    for (std::size_t i = 0; i < runs.size(); ++i) write_run(i);
  else
    tbb::task_arena(threads).execute([&] {
      tbb::parallel_for(std::size_t{0}, runs.size(), write_run, tbb::simple_partitioner());
    });
  part_bytes_ += written;
  return parts;
}

void PartedMeshSink::append_whole(FileWriter& out) {
  out.append_file(rows_);
  out.append_file(triangles_);
}

}  // namespace isobrick
