#include "filters/mesh_spool.h"

#include <limits>

#include <isobrick/error.h>

namespace isobrick::inline v0 {

void check_vertex_count(std::uint64_t vertices) {
  // The largest number is left for what stands for none.
  if (vertices > std::numeric_limits<std::uint32_t>::max())
    throw Error(
        "the mesh has more than 4294967295 vertices, which filters of meshes cannot number; "
        "extract parts with --roi, or a coarser --level");
}

// Positions and triangles are read at random; normals are passed on in order.
MeshSpool::MeshSpool(const ScratchPlace& place, std::uint64_t memory)
    : positions_(place, memory / 2),
      normals_(place, memory / 8),
      triangles_(place, memory / 8 * 3) {}

void MeshSpool::append(const MeshChunk& chunk) {
  check_vertex_count(positions_.size() + chunk.positions.size());
  positions_.append(chunk.positions);
  normals_.append(chunk.normals);
  triangles_.append(chunk.triangles);
}

std::uint64_t MeshSpool::bytes() const {
  return (positions_.size() + normals_.size()) * sizeof(Vec3f) +
         triangles_.size() * sizeof(Triangle);
}

std::uint64_t MeshSpool::memory() const {
  return positions_.memory() + normals_.memory() + triangles_.memory();
}

void MeshSpool::write_vertices(MeshSink& to) {
  // Pages of both arrays have as many elements.
  positions_.for_each_run([&](std::span<const Vec3f> positions, std::uint64_t first) {
    MeshChunk chunk{.first_vertex = first, .positions = positions};
    if (has_normals_) chunk.normals = {&normals_[first], positions.size()};
    to.write(chunk);
  });
}

void MeshSpool::write_triangles(MeshSink& to) {
  triangles_.for_each_run([&](std::span<const Triangle> triangles, std::uint64_t) {
    to.write({.first_vertex = positions_.size(), .triangles = triangles});
  });
}

void MeshSpool::replay(MeshSink& to) {
  write_vertices(to);
  write_triangles(to);
}

void MeshSpool::replay_and_release(MeshSink& to) {
  write_vertices(to);
  normals_.release();
  write_triangles(to);
  release();
}

void MeshSpool::release() {
  positions_.release();
  normals_.release();
  triangles_.release();
}

}  // namespace isobrick
