#pragma once

#include <compare>
#include <cstdint>
#include <memory>
#include <vector>

#include "surface/grid_view.h"
#include "viewer/scene/node_mesh.h"
#include "viewer/scene/node_samples.h"

namespace isobrick::inline v0 {

/// A brick of a stored level.
struct StoredBrick {
  int level = 0;
  Index z = 0, y = 0, x = 0;
  friend auto operator<=>(const StoredBrick&, const StoredBrick&) = default;
};

/// Makes node meshes. Not thread-safe; it keeps its buffers, so use one for each thread.
///
/// A grid point on a face, edge or corner that a coarser neighbour shares takes the neighbour's
/// value. Both sides then cross the edges of the coarser grid at the same points. Vertices of the
/// finer side between them are moved onto the coarser side's chords. Nodes of one level have the
/// same samples on a common face, and so the same vertices, bit by bit.
class NodeMesher {
 public:
  /// `origin`: world space, subtracted from all positions. `inside`: nullopt means inside_of().
  NodeMesher(const NodeGrid& grid, ResidentBricks& bricks, Vec3d origin,
             std::optional<Inside> inside = std::nullopt);
  ~NodeMesher();

  /// Makes the mesh of a node; the neighbours in the mask `coarser` lie one level above. Throws
  /// OperationCancelled, DamageError, and what reading bricks throws.
  NodeMesh mesh(const NodeKey& key, double isovalue, std::uint32_t coarser,
                const CancellationToken& token);

  /// Form of a grid's samples. Stored samples, for a device, take less time and memory than values.
  enum class Form : std::uint8_t { values, stored_if_possible };
  /// Returns the grid that mesh() extracts from, valid until the next call. Throws the same.
  GridView grid(const NodeKey& key, double isovalue, std::uint32_t coarser,
                const CancellationToken& token, Form form = Form::values);

  /// Makes the mesh of the values that grid() returned last. `mesh` names the node.
  NodeMesh extract(const GridView& grid, NodeMesh mesh);

  /// Whether at least half of the bricks that the node's mesh needs are resident. Reads nothing:
  /// without known ranges it counts all bricks of the node's points.
  bool is_half_resident(const NodeKey& key, double isovalue, std::uint32_t coarser) const;

  /// Adds the bricks that the mesh needs and that are not resident.
  void add_missing(const NodeKey& key, double isovalue, std::uint32_t coarser,
                   std::vector<StoredBrick>& missing) const;

  /// Announces the bricks that the mesh needs soon, but not those of its neighbours; see
  /// ResidentBricks::will_need(). Throws what reading ranges throws.
  void will_need(const NodeKey& key, double isovalue, std::uint32_t coarser) const;

  /// Seconds of meshing so far, without waiting for bricks or a device.
  double seconds() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace isobrick
