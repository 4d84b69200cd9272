#pragma once

#include <string>
#include <vector>

#include "io/meshes/levels/chunk_lattice.h"
#include "io/meshes/levels/level_writer.h"

namespace isobrick::inline v0 {

/// A level of a segment, as neuroglancer's manifest has it.
struct ManifestLevel {
  float scale = 0;                         ///< how fine it is, in world units
  std::vector<EncodedFragment> fragments;  ///< in the order of their keys
};

/// Adds the empty fragments that neuroglancer's octree needs: parents of all fragments, and a child
/// where a half of a parent has triangles. Without such a child neuroglancer would draw that half
/// of the coarse level among the fragments of the fine one.
void complete_octree(std::vector<ManifestLevel>& levels);

/// The bytes of a manifest (neuroglancer_multilod_draco) of levels whose octree is complete, from
/// the finest to the coarsest.
std::string manifest_bytes(const ChunkGrid& grid, const std::vector<ManifestLevel>& levels);

}  // namespace isobrick
