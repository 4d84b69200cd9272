#pragma once

#include <cstdint>
#include <vector>

#include "viewer/scene/drawable.h"
#include "viewer/scene/node_mesher.h"

namespace isobrick::inline v0 {

/// A mesh to make.
struct MeshJob {
  NodeKey key;
  double isovalue = 0;
  std::uint32_t coarser = 0;
  bool visible = false, resident = false;
  float pixels = 0, distance = 0;

  bool same_mesh(const MeshJob& other) const {
    return key == other.key && isovalue == other.isovalue && coarser == other.coarser;
  }
};

struct MeshPlan {
  /// The meshes that a cut lacks, the most urgent first: visible nodes; of those, nodes with half
  /// of their bricks resident (NodeMesher::is_half_resident()); coarse ones; the longest cells on
  /// the picture; the nearest. A node without any mesh adds its stored ancestors, which are
  /// substituted for it.
  std::vector<MeshJob> jobs;
  /// Of the ancestors only the coarsest stored ones are made, because all meshes of the cut come
  /// soon.
  bool skips_levels = false;
};

/// Plans the meshes that a cut lacks; reads nothing. Where most of a cut is new and it lacks no
/// more than `max_meshes` meshes, the plan skips intermediate levels.
MeshPlan plan_jobs(const NodeTree& tree, const Cut& cut, MeshCache& meshes,
                   const NodeMesher& mesher, double max_meshes);

}  // namespace isobrick
