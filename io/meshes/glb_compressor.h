#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "io/meshes/gltf/glb_scene.h"
#include "io/meshes/mesh_parts.h"

namespace isobrick::inline v0 {

/// Turns parts of a welded mesh into compressed primitives (EXT_meshopt_compression). A part
/// becomes one, or several where it names too many vertices for one. The order of triangles stays;
/// vertices of a primitive are in the order in which its triangles name them, and those that none
/// names are left out.
class GlbCompressor {
 public:
  /// Primitives have so many triangles at most, and three quarters as many vertices.
  GlbCompressor(const GlbVertices& vertices, FileWriter& out, std::uint64_t max_triangles);

  /// Appends a part of `mesh` to `out`.
  void add(const StoredMesh& mesh, const MeshPart& part);
  /// What was added. Offsets are those in `out`.
  std::vector<GlbPrimitive> take_primitives() { return std::move(primitives_); }

  /// Bytes that it holds at most, where a part has no more vertices than triangles. Any further
  /// one takes four.
  static std::uint64_t memory_with(std::uint64_t max_triangles);

 private:
  std::uint64_t max_vertices() const { return max_vertices_of(max_triangles_); }
  static std::uint64_t max_vertices_of(std::uint64_t triangles);
  void add_triangle(const Triangle& triangle);
  void finish_primitive(const StoredMesh& mesh, const MeshPart& part);
  std::vector<std::byte> field_rows(const GlbField& field, const StoredMesh& mesh,
                                    const MeshPart& part) const;
  BufferRange append(std::span<const std::byte> bytes);

  const GlbVertices& vertices_;
  FileWriter& out_;
  std::uint64_t max_triangles_;
  std::vector<GlbPrimitive> primitives_;
  std::vector<Triangle> triangles_;     ///< of the next primitive, in its own numbers
  std::vector<std::uint32_t> numbers_;  ///< in it, of the part's vertices; kUnnamed
  std::uint32_t named_ = 0;
};

}  // namespace isobrick
