#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "core/flat_map.h"
#include "viewer/scene/cut.h"
#include "viewer/scene/mesh_cache.h"

namespace isobrick::inline v0 {

struct NodeDraw {
  MeshPtr mesh;
  int isovalue = 0;  ///< index in the cut's isovalues; selects the colour
};

/// The meshes that show the scene now. For each isovalue no two nodes overlap. Meshes without
/// triangles are left out unless they are damaged.
struct Drawable {
  std::vector<NodeDraw> nodes;
  std::uint64_t version = 0;      ///< changes with the nodes
  bool complete = false;          ///< shows every node of the cut, without substitutes
  std::vector<double> isovalues;  ///< of the cut
  bool covers = false;            ///< every isovalue is shown without holes
  std::uint64_t triangles = 0;
};

/// Finds nodes of a cut by their keys.
class CutIndex {
 public:
  explicit CutIndex(const Cut& cut);
  /// Null if the key is not in the cut.
  const CutNode* find(const NodeKey& key) const;

 private:
  std::vector<CutNode> nodes_;
  FlatMap<std::uint32_t, NodeKey> numbers_;
};

/// Appends the meshes that show one isovalue of a cut. A missing mesh is substituted by the node's
/// finished finer nodes, or by its nearest finished ancestor. `number`: the isovalue's index.
/// Returns false if some part cannot be shown; the parts around it are appended. Sets `complete` to
/// false where there is any substitute.
bool append_drawable(const NodeTree& tree, const CutIndex& cut, double isovalue, int number,
                     MeshCache& meshes, std::vector<NodeDraw>& nodes, bool& complete);

}  // namespace isobrick
