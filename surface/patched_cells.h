#pragma once

#include <type_traits>

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
    for (int c = 0; c < 8; ++c) {
      const auto v = static_cast<double>(
          first[(c & 1) + (c >> 1 & 1) * TileLayout::kRow + (c >> 2) * TileLayout::kPlane]);
      // The isovalue of an active cell of integers is finite.
      d[c] = std::is_integral_v<T> ? v - isovalue : cell_topology::above_isovalue(v, isovalue);
    }
  }
};

/// After count_tile: takes the cells whose patch the case tables do not have out of the tile's
/// list, finds their patches, numbers their inner vertices and completes the counts.
void count_patched_cells(ScalarType type, const KernelContext& context, TileState& tile);

}  // namespace isobrick
