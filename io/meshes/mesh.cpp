#include <isobrick/mesh.h>

#include <algorithm>

#include <isobrick/mesh_file_sink.h>

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

}  // namespace

void Mesh::save(const std::filesystem::path& path) const { save(path, {}); }

void Mesh::save(const std::filesystem::path& path, const MeshFileOptions& options) const {
  const std::unique_ptr<MeshSink> sink = create_mesh_file(path, options);
  sink->begin(header_of_mesh(*this));
  sink->write(chunk());
  sink->finish();
}

}  // namespace isobrick
