#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include <isobrick/mesh.h>
#include <isobrick/vec.h>
#include "viewer/render/gl_objects.h"

namespace isobrick::inline v0 {

struct MeshBlock;

/// The position of a mesh in buffers that it shares with others.
struct MeshPlace {
  unsigned positions = 0, normals = 0, triangles = 0;  ///< names of OpenGL buffers
  std::uint32_t first_vertex = 0, vertices = 0;        ///< 12 bytes each
  std::uint32_t first_triangle = 0, triangle_count = 0;
};

/// A mesh in a pool; destroying it frees its space. Its triangles index from its first vertex.
/// Destroy it in a current context that shares the pool's objects.
class PooledMesh {
 public:
  PooledMesh() = default;
  PooledMesh(PooledMesh&&) noexcept = default;
  PooledMesh& operator=(PooledMesh&& other) noexcept;
  ~PooledMesh() { reset(); }

  bool empty() const { return place_.triangle_count == 0; }
  bool has_normals() const { return has_normals_; }
  /// World position of (0, 0, 0) in the mesh's coordinates.
  Vec3d origin() const { return origin_; }
  const MeshPlace& place() const { return place_; }
  /// Bytes of device memory.
  std::uint64_t bytes() const;
  void reset();

 private:
  friend class MeshPool;
  std::shared_ptr<MeshBlock> block_;
  MeshPlace place_;
  Vec3d origin_;
  bool has_normals_ = false;
};

/// An incremental copy of a mesh into a pool. The source must live until done().
class MeshCopy {
 public:
  bool done() const { return parts_.empty(); }
  std::uint64_t bytes_left() const;
  /// Copies about `bytes` more, at least one byte.
  void advance(std::uint64_t bytes);
  /// The mesh, once done().
  PooledMesh take() { return std::move(mesh_); }

 private:
  friend class MeshPool;
  struct Part {
    unsigned buffer;
    std::uint64_t offset;
    std::span<const std::byte> from;
  };

  PooledMesh mesh_;
  std::vector<Triangle> finite_triangles_;  ///< the finite triangles, if not all are
  std::vector<Part> parts_;                 ///< next one last
};

/// Stores meshes of any size in a few large buffers, so that one call draws thousands. One thread
/// at a time, with a context current.
class MeshPool {
 public:
  /// `block_vertices`: capacity of a block, which holds twice as many triangles. A larger mesh gets
  /// a block of its own.
  explicit MeshPool(std::uint32_t block_vertices = 1u << 19);
  ~MeshPool();

  /// Copies a mesh whose triangles index from its own first vertex. Triangles with a coordinate
  /// that is not finite are left out. Throws Error for an index out of range, and if device memory
  /// is short.
  PooledMesh add(const MeshChunk& mesh, Vec3d origin = {});
  /// The same, but copies nothing yet.
  MeshCopy begin(const MeshChunk& mesh, Vec3d origin = {});

  /// Whether the mesh may share a block with others.
  bool shares_block(const MeshChunk& mesh) const;
  /// Whether add() finds space for it in a present block.
  bool has_room(const MeshChunk& mesh) const;

  /// A mesh with normals in buffers of another owner, who keeps them while it is drawn.
  static PooledMesh borrow(const MeshPlace& place, Vec3d origin = {});

  /// Frees empty blocks.
  void trim();
  /// Frees all empty blocks but one, which the next mesh reuses.
  void trim_but_one();

  /// Device memory in use by meshes, and allocated for blocks.
  std::uint64_t bytes() const;
  std::uint64_t capacity() const;

 private:
  /// Reserves space for a mesh.
  PooledMesh reserve(std::uint32_t vertices, std::uint32_t triangles, bool normals, Vec3d origin);

  struct State;
  std::unique_ptr<State> state_;
};

/// The triangles whose vertices are all finite: `mesh`'s own if all are, else a copy in `kept`.
/// Throws Error for an index out of range.
std::span<const Triangle> drawable_triangles(const MeshChunk& mesh, std::vector<Triangle>& kept);

}  // namespace isobrick
