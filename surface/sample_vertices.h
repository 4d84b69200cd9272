#pragma once

#include <cstdint>
#include <span>

#include "core/morton.h"
#include "surface/boundary_map.h"

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

/// The first tile in Morton order, as SampleVertex::owner, with a cell at sample `p` for which
/// has_vertex(cell, corner) holds, where `corner` of the cell is the sample; the tile itself has
/// one. All in coordinates of the tile.
template <class HasVertex>
std::uint8_t first_tile_at(Int3 tile, Int3 p, const HasVertex& has_vertex) {
  const auto side = [](Index cell) -> Index { return cell < 0 ? -1 : cell < kTileEdge ? 0 : 1; };
  std::uint8_t owner = SampleVertex::kOwn;
  std::uint64_t first = morton_encode(tile);
  for (int corner = 0; corner < 8; ++corner) {
    const Int3 cell = p - Int3{corner & 1, corner >> 1 & 1, corner >> 2};
    const std::uint8_t of = neighbour_of({side(cell.x), side(cell.y), side(cell.z)});
    const Int3 other = tile + offset_of(of);
    if (of == SampleVertex::kOwn || of == owner || other.x < 0 || other.y < 0 || other.z < 0)
      continue;
    const std::uint64_t code = morton_encode(other);
    if (code < first && has_vertex(cell, corner)) {
      first = code;
      owner = of;
    }
  }
  return owner;
}

/// Copies the tile's own vertices whose place is_shared() to `published`.
template <class IsShared>
void publish_samples(std::span<const SampleVertex> vertices, const IsShared& is_shared,
                     PodBuffer<SharedSample>& published) {
  const auto for_each_shared = [&](auto&& f) {
    for (const SampleVertex& vertex : vertices)
      if (vertex.owner == SampleVertex::kOwn && is_shared(vertex.place)) f(vertex);
  };
  std::size_t count = 0;
  for_each_shared([&](const SampleVertex&) { ++count; });
  published.clear();
  published.reserve(count);  // no more than that: boundaries are what a budget counts
  for_each_shared([&](const SampleVertex& vertex) {
    published.resize(published.size() + 1);
    published[published.size() - 1] = {vertex.place, vertex.number};
  });
}

/// Turns the numbers of vertices into those of the mesh. Vertices of tiles before are looked up in
/// the list `published` of their boundaries.
void adopt_samples(const TileState& tile, PodBuffer<SharedSample> TileBoundary::*published,
                   const BoundaryMap& map, PodBuffer<SampleVertex>& vertices);

}  // namespace isobrick
