#pragma once

#include <cstdint>

#include "gpu/tile/on_samples_params.h"
#include "surface/cell_topology.h"

// What the extraction kernel needs to follow the trilinear interpolant (surface/patched_cells.h).
// Plain data, no CUDA header.

namespace isobrick::inline v0::gpu {

/// What a block of threads notes of the tile that it works on: cells whose patch the case tables do
/// not have.
struct TrilinearWork {
  std::uint32_t cells[kRowsOfTile];           ///< bit x: such a cell
  std::uint32_t triangles[kRowsOfTile];       ///< of such cells in the rows before
  std::uint32_t vertices[kRowsOfTile];        ///< within such cells, in the rows before
  std::uint16_t patches[32 * 32 * 32];        ///< of such cells, of TopologyTables
  std::uint32_t any;                          ///< whether there are such cells
  std::uint32_t own_vertices, own_triangles;  ///< of all of them
};

/// Blocks of threads that such a kernel has at most: each has a TrilinearWork.
inline constexpr int kMaxTrilinearBlocks = 512;

struct TrilinearParams {
  TrilinearWork* work;           ///< one a block of threads
  const TopologyTables* tables;  ///< on the device
};

}  // namespace isobrick::gpu
