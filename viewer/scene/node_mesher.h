#pragma once

#include <compare>
#include <cstdint>
#include <memory>
#include <vector>

#include "surface/grid_view.h"
#include "viewer/scene/node_mesh.h"
#include "viewer/scene/node_samples.h"

namespace isobrick {

/// A brick of a stored level.
struct StoredBrick {
  int level = 0;
  Index z = 0, y = 0, x = 0;
  friend auto operator<=>(const StoredBrick&, const StoredBrick&) = default;
};

/// Makes node meshes. One for each thread: keeps its work space.
///
/// A grid point that lies in a coarser neighbour as well (on a face, an edge or a
/// corner) takes the value that the neighbour has there. Both sides then cross the
/// same edges of the coarser grid at the same points; vertices of the finer side
/// between them are moved onto the coarser side's chords. Nodes of one level have
/// the same samples on the face between them and so the same vertices, bit by bit.
class NodeMesher {
 public:
  /// `origin`, in world space, is subtracted from all positions. `inside`: nothing is what
  /// inside_of() says.
  NodeMesher(const NodeGrid& grid, ResidentBricks& bricks, Vec3d origin,
             std::optional<Inside> inside = std::nullopt);
  ~NodeMesher();

  /// The mesh of a node whose neighbours in `coarser` (directions) lie one level
  /// above. Throws OperationCancelled, DamageError and what else reading bricks throws.
  NodeMesh mesh(const NodeKey& key, double isovalue, std::uint32_t coarser,
                const CancellationToken& token);

  /// Whether a grid may hold samples as they are stored instead of values, which takes less time
  /// and memory: for a device.
  enum class Form : std::uint8_t { values, stored_if_possible };
  /// What that mesh is made of. Valid until the next call; throws the same.
  GridView grid(const NodeKey& key, double isovalue, std::uint32_t coarser,
                const CancellationToken& token, Form form = Form::values);

  /// The mesh of the values that grid() gave last. `mesh` says which it is.
  NodeMesh extract(const GridView& grid, NodeMesh mesh);

  /// Whether at least half of the bricks are there that hold a node's points and that the mesh
  /// needs. Reads nothing: where ranges have not been read, it seems to need all of them.
  bool half_resident(const NodeKey& key, double isovalue, std::uint32_t coarser) const;

  /// Adds those of these bricks that are not there.
  void add_missing(const NodeKey& key, double isovalue, std::uint32_t coarser,
                   std::vector<StoredBrick>& missing) const;

  /// Says which bricks the mesh needs soon, its neighbours' left out; see
  /// ResidentBricks::will_need(). Throws what reading ranges does.
  void will_need(const NodeKey& key, double isovalue, std::uint32_t coarser) const;

  /// Seconds that this thread spent on meshing so far, without waiting for bricks or a device.
  double seconds() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace isobrick
