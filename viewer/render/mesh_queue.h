#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "viewer/render/mesh_pool.h"
#include "viewer/render/renderer.h"

namespace isobrick {

/// Triangles of a mesh and how they look.
struct MeshDraw {
  const PooledMesh* mesh;
  MeshStyle style;
  std::uint32_t first_triangle, triangles;  ///< of the mesh's

  /// Tells the blocks of a pool apart.
  unsigned block() const { return mesh->place().positions; }
};

/// Whether any half space of the picture may cut a mesh of this style.
inline bool may_be_clipped(const MeshStyle& style) { return style.clip_mask != 0; }

/// Meshes that are to be drawn, in pieces of any size. However large the pieces are, the triangles
/// have one order.
class MeshQueue {
 public:
  /// Meshes of one block of a pool that are cut, or not, together, which takes fewer calls, or all
  /// as they were added, so that it does not show where in the pool they lie.
  enum class Order : std::uint8_t { blocks, added };

  explicit MeshQueue(Order order = Order::added) : sorted_(order == Order::added) {}

  /// Before the first take(); `mesh` must live until the last of those.
  void add(const PooledMesh& mesh, const MeshStyle& style);

  bool empty() const { return left_ == 0; }
  /// That have not been taken.
  std::uint64_t triangles() const { return left_; }

  /// The next ones, `max_triangles` triangles at max_triangles and one at least; valid until the
  /// next call. The queue must not be empty.
  std::span<const MeshDraw> take(std::uint64_t max_triangles);

 private:
  std::vector<MeshDraw> draws_, batch_;
  std::size_t next_ = 0;
  std::uint64_t left_ = 0;
  bool sorted_;
};

}  // namespace isobrick
