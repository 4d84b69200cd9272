#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "viewer/scene/active_nodes.h"
#include "viewer/scene/node_flags.h"
#include "viewer/scene/node_tree.h"
#include "viewer/scene/view.h"

namespace isobrick::inline v0 {

/// Limits of an LOD cut. They are compared with estimates: a node's triangles are its active blocks
/// times `triangles_per_block`, and 0 where the node is clipped.
struct CutBudget {
  std::uint64_t triangles = 20'000'000;
  /// Limit of all triangles where nodes that lose thin structure need more than `triangles`: one
  /// such node may need more than a whole preview.
  std::uint64_t thin_triangles = 0;
  std::uint64_t mesh_bytes = std::uint64_t{2} << 30;
  double triangles_per_block = 600;

  friend bool operator==(const CutBudget&, const CutBudget&) = default;
};

/// Bytes of mesh for each triangle: three indices, and half a vertex with a normal.
inline constexpr std::uint64_t kBytesPerTriangle = 24;

struct CutNode {
  NodeKey key;
  /// Mask of directions; the neighbour there lies one level above, and the border must match it. A
  /// clipped neighbour is left out, since the border to it is not visible. At the finest level so
  /// is a neighbour without any surface.
  std::uint32_t coarser = 0;
  float pixels = 0;    ///< length of a cell on the picture, pixels
  float distance = 0;  ///< from the eye, world units
  bool visible = false;
  bool clipped = false;  ///< completely outside the clip region: needs no mesh
};

/// An LOD cut: a set of nodes that covers the volume once. Neighbours over faces, edges and corners
/// differ by at most one level.
struct Cut {
  std::vector<CutNode> nodes;
  std::vector<double> isovalues;
  std::uint64_t triangles = 0;     ///< estimate
  bool limited_by_budget = false;  ///< would be finer without the budget
};

/// Chooses LOD cuts. It remembers the last one, so that small motions of the camera do not change
/// the cut: use one selector for a window. Not thread-safe.
class CutSelector {
 public:
  explicit CutSelector(const NodeTree& tree);

  /// Chooses the cut for a view. It refines the node with the longest cells on the picture first,
  /// as long as the cells are longer than the view's pixel error, the node is visible and active
  /// below, and the budget lasts.
  ///
  /// Up to half of the budget goes first to nodes that lose thin structure (NodeTree::loses). With
  /// `thin_triangles`, ThinStructure counts as well, and such nodes get all of it but the other
  /// half of the budget. The result depends on the arguments, the previous cut, and whether
  /// ThinStructure is known.
  Cut select(const ActiveNodes& active, const View& view, const CutBudget& budget);

 private:
  bool loses(const NodeKey& n, const ActiveNodes& active, const CutBudget& budget) const;
  double priority(const NodeKey& n, const NodeSight& sight, const ActiveNodes& active);
  double triangles(const NodeKey& n, const NodeView& view, std::span<const double> isovalues,
                   double per_block) const;
  double added_triangles(std::span<const NodeKey> refined, const NodeView& view,
                         std::span<const double> isovalues, double per_block) const;
  void collect(const NodeKey& n, std::vector<NodeKey>& needed);
  std::uint32_t coarse_around(const NodeKey& n, const NodeView& view, const ActiveNodes& active);
  void append(const NodeKey& n, std::uint32_t coarser, const NodeView& view,
              const ActiveNodes& active, Cut& cut);

  const NodeTree& tree_;
  // Nodes outside the volume count as refined, so that no code tries to refine them.
  NodeFlags refined_, previous_, queued_;
};

}  // namespace isobrick
