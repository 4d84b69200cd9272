#pragma once

#include <isobrick/inside.h>
#include <isobrick/lattice.h>
#include <isobrick/mesh.h>
#include <isobrick/topology.h>
#include <isobrick/transform.h>

namespace isobrick::inline v0 {

/// Which surface of a lattice to extract, and what of it.
struct SurfaceOptions {
  double isovalue = 0;                   ///< in the values of the samples
  Inside inside = Inside::above;         ///< which side of the surface is its inside
  bool normals = false;                  ///< gradient normals
  Indexing indexing = Indexing::welded;  ///< how triangles name their vertices
  /// Leaves triangles without area out where samples equal the isovalue: the
  /// vertices around such a sample become one, the mesh stays welded and closed.
  bool drop_degenerate = false;
  Topology topology = Topology::consistent;  ///< of ambiguous cells
  /// Closes the surface at the border of the region and around cells that a NaN leaves out.
  bool cap = false;
  /// Samples between which cells are looked at.
  Box3 roi = {};
  Transform transform = {};  ///< index space to world space
  double fill_value = 0;     ///< of absent bricks
  /// Whether samples may be NaN: costs a look at every sample's neighbours.
  bool may_have_nan = false;
};

}  // namespace isobrick
