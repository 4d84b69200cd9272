#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "viewer/render/mesh_pool.h"
#include "viewer/render/renderer.h"

namespace isobrick::inline v0 {

/// Triangles of a mesh and their style.
struct MeshDraw {
  const PooledMesh* mesh;
  MeshStyle style;
  std::uint32_t first_triangle, triangles;

  /// Identifies the block of the pool.
  unsigned block() const { return mesh->place().positions; }
};

/// Whether a half space of the picture may clip a mesh of this style.
inline bool may_be_clipped(const MeshStyle& style) { return style.clip_mask != 0; }

/// Meshes to draw, taken in batches. The size of the batches does not change the order of the
/// triangles.
class MeshQueue {
 public:
  /// `blocks` groups meshes by pool block and by whether they are clipped, which takes fewer calls.
  /// `added` keeps the order of add(), so that a mesh's position in the pool does not show.
  enum class Order : std::uint8_t { blocks, added };

  explicit MeshQueue(Order order = Order::added) : sorted_(order == Order::added) {}

  /// Call it before the first take(). `mesh` must live until the last one.
  void add(const PooledMesh& mesh, const MeshStyle& style);

  bool empty() const { return remaining_ == 0; }
  /// Triangles that remain.
  std::uint64_t triangles() const { return remaining_; }

  /// Takes the next batch: at least one triangle, at most `max_triangles`. Valid until the next
  /// call. The queue must not be empty.
  std::span<const MeshDraw> take(std::uint64_t max_triangles);

 private:
  std::vector<MeshDraw> draws_, batch_;
  std::size_t next_ = 0;
  std::uint64_t remaining_ = 0;
  bool sorted_;
};

}  // namespace isobrick
