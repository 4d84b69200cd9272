#pragma once

#include <cstdint>
#include <span>

#include "surface/boundary_map.h"
#include "surface/tile_kernels.h"

// Vertices on samples, which several tiles may have triangles at. One of these tiles makes the
// vertex, and the others look it up in that tile's boundary.

namespace isobrick::inline v0 {

/// Tiles around a tile: offset (x, y, z), each in −1 … 1, and back.
constexpr std::uint8_t neighbour_of(Int3 offset) {
  return static_cast<std::uint8_t>(offset.x + 1 + 3 * (offset.y + 1 + 3 * (offset.z + 1)));
}
constexpr Int3 offset_of(std::uint8_t neighbour) {
  return {neighbour % 3 - 1, neighbour / 3 % 3 - 1, neighbour / 9 - 1};
}

/// After count_coincident and count_cap, which mark the used samples: lists them in the order of
/// their places, finds the tile that makes each one's vertex, and counts the tile's own.
/// `unwelded`: no tile shares vertices with another.
void list_sample_vertices(ScalarType type, const KernelContext& context, bool unwelded,
                          TileState& tile);

/// Copies the tile's own vertices on samples that other tiles have as well to its boundary.
void publish_sample_vertices(const KernelContext& context, TileState& tile);

/// Turns the numbers of vertices on samples into those of the mesh; vertices of tiles before are
/// looked up in their boundaries.
void adopt_sample_vertices(TileState& tile, const BoundaryMap& map);

}  // namespace isobrick
