#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include <isobrick/mesh.h>
#include <isobrick/vec.h>
#include "viewer/render/gl_objects.h"

namespace isobrick {

struct MeshBlock;

/// Where a mesh lies in the buffers that it shares with others.
struct MeshPlace {
  unsigned positions = 0, normals = 0, triangles = 0;  ///< names of OpenGL buffers
  std::uint32_t first_vertex = 0, vertices = 0;        ///< of 12 bytes each
  std::uint32_t first_triangle = 0, triangle_count = 0;
};

/// A mesh in a pool; its room is free again when it is destroyed. Numbers of its
/// triangles count from its first vertex. To be destroyed in a current context
/// that shares the pool's objects.
class PooledMesh {
 public:
  PooledMesh() = default;
  PooledMesh(PooledMesh&&) noexcept = default;
  PooledMesh& operator=(PooledMesh&& other) noexcept;
  ~PooledMesh() { reset(); }

  bool empty() const { return place_.triangle_count == 0; }
  bool has_normals() const { return has_normals_; }
  /// World position of (0, 0, 0) in the mesh's own coordinates.
  Vec3d origin() const { return origin_; }
  const MeshPlace& place() const { return place_; }
  /// Of device memory.
  std::uint64_t bytes() const;
  void reset();

 private:
  friend class MeshPool;
  std::shared_ptr<MeshBlock> block_;
  MeshPlace place_;
  Vec3d origin_;
  bool has_normals_ = false;
};

/// A mesh on its way into a pool. What it is copied from must live until it is done.
class MeshCopy {
 public:
  bool done() const { return parts_.empty(); }
  /// Of what is copied.
  std::uint64_t bytes_left() const;
  /// Copies about so many bytes more, at least one.
  void advance(std::uint64_t bytes);
  /// Once it is done.
  PooledMesh take() { return std::move(mesh_); }

 private:
  friend class MeshPool;
  struct Part {
    unsigned buffer;
    std::uint64_t offset;
    std::span<const std::byte> from;
  };

  PooledMesh mesh_;
  std::vector<Triangle> finite_triangles_;  ///< triangles, where not all are
  std::vector<Part> parts_;                 ///< the next one last
};

/// Meshes of any size in a few large buffers, so that thousands are drawn with one
/// call. One thread at a time, with a context current.
class MeshPool {
 public:
  /// `block_vertices`: room of a block; it has twice as many triangles. Larger
  /// meshes get a block of their own.
  explicit MeshPool(std::uint32_t block_vertices = 1u << 19);
  ~MeshPool();

  /// Copies a mesh whose triangles count from its own first vertex. Triangles with a
  /// coordinate that is not finite are left out. Throws Error for triangles
  /// that name other vertices, and when device memory is short.
  PooledMesh add(const MeshChunk& mesh, Vec3d origin = {});
  /// The same, with nothing copied yet.
  MeshCopy begin(const MeshChunk& mesh, Vec3d origin = {});

  /// Whether it may lie in a block with others, and not in one of its own.
  bool shares_block(const MeshChunk& mesh) const;
  /// Whether add() finds room for it in a block that there is.
  bool has_room(const MeshChunk& mesh) const;

  /// A mesh with normals in buffers that somebody else owns, and keeps while it is drawn.
  static PooledMesh borrow(const MeshPlace& place, Vec3d origin = {});

  /// Gives blocks back that no mesh lies in.
  void trim();
  /// All of these but one, for what comes next.
  void tidy();

  /// Device memory in use by meshes, and taken for blocks.
  std::uint64_t bytes() const;
  std::uint64_t capacity() const;

 private:
  /// Room for a mesh.
  PooledMesh reserve(std::uint32_t vertices, std::uint32_t triangles, bool normals, Vec3d origin);

  struct State;
  std::unique_ptr<State> state_;
};

/// The triangles whose vertices are all finite: `mesh`'s own if all are, else a copy in
/// `kept`. Throws Error for a triangle that names a vertex beyond the mesh's.
std::span<const Triangle> drawable_triangles(const MeshChunk& mesh, std::vector<Triangle>& kept);

}  // namespace isobrick
