#pragma once

#include "surface/inner_vertices.h"
#include "surface/tile_kernels.h"
#include "surface/tile_state.h"
#include "surface/topology_tables.h"

// Cells whose surface follows the trilinear interpolant (Topology::trilinear) where that differs
// from the case tables. See docs/design/surface.md.

namespace isobrick::inline v0 {

/// The corners of a cell in a tile's samples, less the isovalue.
template <class T>
struct CellValues {
  double d[8];

  CellValues(const T* samples, double isovalue, int x, int y, int z) {
    const T* first = samples + TileLayout::offset(x, y, z);
    cell_topology::load_values<T>(d, isovalue, [&](int c) {
      return first[(c & 1) + (c >> 1 & 1) * TileLayout::kRow + (c >> 2) * TileLayout::kPlane];
    });
  }
};

/// After count_tile: takes the cells whose patch the case tables do not have out of the tile's
/// list, finds their patches, numbers their inner vertices and completes the counts.
void count_patched_cells(ScalarType type, const KernelContext& context, TileState& tile);

}  // namespace isobrick
