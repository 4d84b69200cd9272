#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "viewer/scene/active_nodes.h"
#include "viewer/scene/node_flags.h"
#include "viewer/scene/node_tree.h"
#include "viewer/scene/view.h"

namespace isobrick {

/// What a cut may hold. Estimates: a node's triangles are its active blocks
/// times `triangles_per_block`; none where all of it is cut away.
struct CutBudget {
  std::uint64_t triangles = 20'000'000;
  /// A cut of more than `triangles` may have up to so many, where nodes need them that lose thin
  /// structure: a coarse node may take less than its one surface of the next level.
  std::uint64_t thin_triangles = 0;
  std::uint64_t mesh_bytes = std::uint64_t{2} << 30;
  double triangles_per_block = 600;

  friend bool operator==(const CutBudget&, const CutBudget&) = default;
};

/// Bytes of mesh for each triangle: its corners, and half a vertex with a normal.
inline constexpr std::uint64_t kBytesPerTriangle = 24;

/// A node of a cut.
struct CutNode {
  NodeKey key;
  /// Directions in which a neighbour lies one level above that is to be met; not one that is cut
  /// away, since nobody sees whether it is met, nor, of the finest level, one without any surface.
  std::uint32_t coarser = 0;
  float pixels = 0;    ///< a cell's length on the picture
  float distance = 0;  ///< from the eye, world length
  bool visible = false;
  bool clipped = false;  ///< nothing of it is shown: it needs no mesh
};

/// A set of nodes that covers the volume once. Face, edge and corner neighbours
/// differ by at most one level.
struct Cut {
  std::vector<CutNode> nodes;
  std::vector<double> isovalues;
  std::uint64_t triangles = 0;     ///< estimate
  bool limited_by_budget = false;  ///< without a budget it would be finer
};

/// Chooses cuts. Keeps what the last one was, so that small motions of the camera
/// do not make nodes come and go: use one for a window. Not thread-safe.
class CutSelector {
 public:
  explicit CutSelector(const NodeTree& tree);

  /// The cut for a view: nodes are refined, the longest cells on the picture first,
  /// while these are longer than the view's pixel error, visible, and not without
  /// any surface (of active.isovalues()) below, and while the budget lasts. Up to half of the
  /// budget goes first to nodes that lose thin structure (NodeTree::loses), and all of
  /// `thin_triangles` but for the other half; then ThinStructure counts as well. A function of its
  /// arguments, of the cut before, and of whether that is known.
  Cut select(const ActiveNodes& active, const View& view, const CutBudget& budget);

 private:
  bool loses(const NodeKey& n, const ActiveNodes& active, const CutBudget& budget) const;
  double urgency(const NodeKey& n, const NodeSight& sight, const ActiveNodes& active);
  double triangles(const NodeKey& n, const NodeView& view, std::span<const double> isovalues,
                   double per_block) const;
  double added_triangles(std::span<const NodeKey> refined, const NodeView& view,
                         std::span<const double> isovalues, double per_block) const;
  void collect(const NodeKey& n, std::vector<NodeKey>& needed);
  std::uint32_t coarse_around(const NodeKey& n, const NodeView& view, const ActiveNodes& active);
  void append(const NodeKey& n, std::uint32_t coarser, const NodeView& view,
              const ActiveNodes& active, Cut& cut);

  const NodeTree& tree_;
  // Nodes beside the volume count as refined: nothing is to be done there.
  NodeFlags refined_, previous_, queued_;
};

}  // namespace isobrick
