#pragma once

#include <isobrick/surface_options.h>
#include "surface/tile_state.h"

namespace isobrick::inline v0 {

/// What the kernels know of the surface, besides the tile.
struct KernelContext {
  double isovalue = 0;
  WorldMap world;
  bool normals = false;
  bool may_have_nan = false;
  Int3 extent;             ///< of the volume: gradients are one-sided at its border
  Box3 roi;                ///< samples between which there are cells
  bool trilinear = false;  ///< Topology::trilinear
  bool cap = false;        ///< closes the surface at the border
  Inside inside = Inside::above;
  Box3 border;  ///< samples between which cells exist for a cap: the roi, or more than that
};

// The two passes over one tile, compiled for several instruction sets; the best
// that the processor has is taken at run time. Results don't depend on it.

/// From gathered samples of `type`: inside bits, own edge rows with numbers
/// that count from the tile's first vertex, active cells, and the counts.
void count_tile(ScalarType type, const KernelContext& context, TileState& tile);

/// With all edge rows complete, foreign ones included: writes the tile's
/// vertices to `positions` (and `normals`, unless null) and its triangles.
void write_tile(ScalarType type, const KernelContext& context, TileState& tile, Vec3f* positions,
                Vec3f* normals, Triangle* triangles);

}  // namespace isobrick
