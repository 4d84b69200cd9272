#include "pipeline/pieces/open_tiles.h"

#include <isobrick/lattice.h>
#include "core/morton.h"
#include "surface/boundary_map.h"

namespace isobrick::inline v0 {

std::uint64_t last_asker(std::uint64_t code, Int3 grid) {
  return morton_encode(min(morton_decode(code), grid - Int3{2, 2, 2}) + Int3{1, 1, 1});
}

OpenTiles::OpenTiles(Int3 extent) : grid_(ceil_div(extent, {kTileEdge, kTileEdge, kTileEdge})) {}

std::uint64_t OpenTiles::bytes(Int3 extent) {
  // An entry of the map with its link and bucket; the lists of a piece's neighbours.
  constexpr std::uint64_t entry = sizeof(Open) + 5 * sizeof(std::uint64_t);
  constexpr std::uint64_t listed = sizeof(PieceTile) + 2 * sizeof(std::uint64_t);
  return BoundaryMap::max_size(ceil_div(extent, {kTileEdge, kTileEdge, kTileEdge})) *
         (entry + listed);
}

void OpenTiles::begin_piece(const TileRange& tiles, const std::vector<PieceTile>& neighbours) {
  std::erase_if(open_,
                [&](const auto& open) { return last_asker(open.first, grid_) < tiles.begin; });
  end_ = tiles.end;
  numbers_.clear();
  fits_ = true;
  for (const PieceTile& tile : neighbours) {
    const auto found = open_.find(tile.code);
    if (found == open_.end() || found->second.vertices != tile.vertices) {
      fits_ = false;
      return;
    }
    numbers_.add(tile.vertices, found->second.first);
  }
}

void OpenTiles::add(const PieceTile& tile, std::uint64_t first) {
  if (tile.vertices > 0 && last_asker(tile.code, grid_) >= end_)
    open_[tile.code] = {first, tile.vertices};
}

}  // namespace isobrick
