#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "core/flat_map.h"
#include "viewer/scene/cut.h"
#include "viewer/scene/mesh_cache.h"

namespace isobrick {

/// A mesh to be drawn.
struct NodeDraw {
  MeshPtr mesh;
  int isovalue = 0;  ///< which of the cut's, for its colour
};

/// What shows the scene now: for each isovalue meshes of nodes no two of which lie
/// over the same place. Meshes without triangles are left out unless they are damaged.
struct Drawable {
  std::vector<NodeDraw> nodes;
  std::uint64_t version = 0;      ///< differs when the nodes do
  bool complete = false;          ///< the whole cut, nothing stands in
  std::vector<double> isovalues;  ///< that the cut asks for
  bool covers = false;            ///< each of them is shown, without holes
  std::uint64_t triangles = 0;
};

/// A cut that is looked up.
class CutIndex {
 public:
  explicit CutIndex(const Cut& cut);
  /// Null when it is not in the cut.
  const CutNode* find(const NodeKey& key) const;

 private:
  std::vector<CutNode> nodes_;
  FlatMap<std::uint32_t, NodeKey> numbers_;
};

/// Appends the meshes that show one isovalue of a cut as far as they are there: a
/// node of the cut, its finished finer nodes, or its nearest finished ancestor
/// instead. False when some part can not be shown; then its surroundings are.
/// `complete` becomes false where anything stands in.
bool append_drawable(const NodeTree& tree, const CutIndex& cut, double isovalue, int number,
                     MeshCache& meshes, std::vector<NodeDraw>& nodes, bool& complete);

}  // namespace isobrick
