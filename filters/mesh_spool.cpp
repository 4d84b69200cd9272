#include "filters/mesh_spool.h"

namespace isobrick::inline v0 {

// Positions and triangles are read at random; normals are passed on in order.
template <class Number>
MeshSpool<Number>::MeshSpool(const ScratchPlace& place, std::uint64_t memory)
    : positions_(place, memory / 2),
      normals_(place, memory / 8),
      triangles_(place, memory / 8 * 3) {}

template <class Number>
void MeshSpool<Number>::append(const MeshChunk& chunk) {
  check_vertex_count<Number>(positions_.size() + chunk.positions.size());
  positions_.append(chunk.positions);
  normals_.append(chunk.normals);
  triangles_.append(triangles_of<Number>(chunk, converted_));
}

template <class Number>
std::uint64_t MeshSpool<Number>::bytes() const {
  return (positions_.size() + normals_.size()) * sizeof(Vec3f) +
         triangles_.size() * sizeof(TriangleOf<Number>);
}

template <class Number>
std::uint64_t MeshSpool<Number>::memory() const {
  return positions_.memory() + normals_.memory() + triangles_.memory();
}

template <class Number>
void MeshSpool<Number>::write_vertices(MeshSink& to) {
  // Pages of both arrays have as many elements.
  positions_.for_each_run([&](std::span<const Vec3f> positions, std::uint64_t first) {
    MeshChunk chunk{.first_vertex = first, .positions = positions};
    if (has_normals_) chunk.normals = {&normals_[first], positions.size()};
    to.write(chunk);
  });
}

template <class Number>
void MeshSpool<Number>::write_triangles(MeshSink& to, bool wide) {
  triangles_.for_each_run([&](std::span<const TriangleOf<Number>> triangles, std::uint64_t) {
    isobrick::write_triangles<Number>(to, wide, positions_.size(), triangles);
  });
}

template <class Number>
void MeshSpool<Number>::replay(MeshSink& to, bool wide) {
  write_vertices(to);
  write_triangles(to, wide);
}

template <class Number>
void MeshSpool<Number>::replay_and_release(MeshSink& to, bool wide) {
  write_vertices(to);
  normals_.release();
  write_triangles(to, wide);
  release();
}

template <class Number>
void MeshSpool<Number>::release() {
  positions_.release();
  normals_.release();
  triangles_.release();
}

template class MeshSpool<std::uint32_t>;
template class MeshSpool<std::uint64_t>;

}  // namespace isobrick
