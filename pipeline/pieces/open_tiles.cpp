#include "pipeline/pieces/open_tiles.h"

#include <algorithm>

#include <isobrick/lattice.h>
#include "core/morton.h"
#include "surface/boundary_map.h"

namespace isobrick::inline v0 {

OpenTiles::OpenTiles(Int3 extent)
    : last_tile_(ceil_div(extent, {kTileEdge, kTileEdge, kTileEdge}) - Int3{1, 1, 1}) {}

std::uint64_t OpenTiles::bytes(Int3 extent) {
  // An entry of the map with its link and bucket; the lists of a piece's neighbours.
  constexpr std::uint64_t entry = sizeof(Open) + 5 * sizeof(std::uint64_t);
  return BoundaryMap::max_size(ceil_div(extent, {kTileEdge, kTileEdge, kTileEdge})) *
         (entry + sizeof(PieceTile) + sizeof(Neighbour));
}

/// The last tile in the order that may use a vertex of this one.
std::uint64_t OpenTiles::last_asker(std::uint64_t code) const {
  return morton_encode(min(morton_decode(code) + Int3{1, 1, 1}, last_tile_));
}

void OpenTiles::begin_piece(const TileRange& tiles, const std::vector<PieceTile>& neighbours) {
  std::erase_if(open_, [&](const auto& open) { return last_asker(open.first) < tiles.begin; });
  end_ = tiles.end;
  neighbours_.clear();
  neighbour_vertices_ = 0;
  fits_ = true;
  for (const PieceTile& tile : neighbours) {
    const auto found = open_.find(tile.code);
    if (found == open_.end() || found->second.vertices != tile.vertices) {
      fits_ = false;
      return;
    }
    neighbours_.push_back({neighbour_vertices_, found->second.first});
    neighbour_vertices_ += tile.vertices;
  }
}

std::uint32_t OpenTiles::number_of(std::uint32_t vertex) const {
  const auto after = std::upper_bound(
      neighbours_.begin(), neighbours_.end(), vertex,
      [](std::uint32_t number, const Neighbour& tile) { return number < tile.begin; });
  const Neighbour& tile = *(after - 1);
  return tile.first + static_cast<std::uint32_t>(vertex - tile.begin);
}

void OpenTiles::add(const PieceTile& tile, std::uint64_t first) {
  if (tile.vertices > 0 && last_asker(tile.code) >= end_)
    open_[tile.code] = {static_cast<std::uint32_t>(first), tile.vertices};
}

}  // namespace isobrick
