#pragma once

#include <span>

#include <isobrick/inside.h>
#include <isobrick/lattice.h>
#include <isobrick/mesh.h>
#include <isobrick/pod_buffer.h>
#include <isobrick/transform.h>

namespace isobrick {

/// Which surface of a lattice to extract, and what of it.
struct SurfaceOptions {
  double isovalue = 0;
  Inside inside = Inside::above;
  bool normals = false;
  Indexing indexing = Indexing::welded;
  /// Leaves triangles without area out where samples equal the isovalue: the
  /// vertices around such a sample become one, the mesh stays welded and closed.
  bool drop_degenerate = false;
  /// Samples between which cells are looked at.
  Box3 roi;
  Transform transform;
  double fill_value = 0;
  /// Whether samples may be NaN: costs a look at every sample's neighbours.
  bool may_have_nan = false;
};

/// A mesh, or the piece of one that is being made. Reused, it allocates nothing.
struct MeshBuffer {
  PodBuffer<Vec3f> positions, normals;
  PodBuffer<Triangle> triangles;

  void clear() {
    positions.clear();
    normals.clear();
    triangles.clear();
  }
  MeshChunk chunk(std::uint64_t first_vertex) const {
    return {first_vertex, positions.span(), normals.span(), triangles.span()};
  }
};

}  // namespace isobrick
