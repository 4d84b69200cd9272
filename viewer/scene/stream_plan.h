#pragma once

#include <cstdint>
#include <vector>

#include "viewer/scene/drawable.h"
#include "viewer/scene/node_mesher.h"

namespace isobrick {

/// A mesh that is wanted.
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

/// The meshes that a cut lacks.
struct MeshPlan {
  /// Most urgent first: visible ones, of them those of whose bricks at least half are there (see
  /// NodeMesher::half_resident(): planning reads nothing), of them coarse ones, then those with the
  /// longest cells on the picture, then near ones. Nodes without any mesh bring the ancestors along
  /// that will stand in for them, of levels that are stored.
  std::vector<MeshJob> jobs;
  /// Intermediate levels are skipped: of ancestors only the coarsest that are stored are made,
  /// because all the rest comes soon.
  bool skips_levels = false;
};

/// `soon`: how many meshes are made so quickly that nothing needs to stand in for them but the
/// coarsest level; that is done where most of a cut is new.
MeshPlan plan_jobs(const NodeTree& tree, const Cut& cut, MeshCache& meshes,
                   const NodeMesher& mesher, double max_meshes);

}  // namespace isobrick
