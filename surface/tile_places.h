#pragma once

#include <cstdint>

#include "core/tile_range.h"

namespace isobrick::inline v0 {

/// Where what a tile makes lies in the mesh of its extractor.
struct TilePlace {
  std::uint64_t code = 0;          ///< morton_encode() of the tile
  std::uint32_t first_vertex = 0;  ///< number of the tile's first vertex
  std::uint32_t vertices = 0;
  std::uint32_t triangles = 0;
  std::uint32_t degenerate = 0;  ///< triangles left out
};

/// Hears which tiles a mesh is made of, in their order. A tile is placed before the sink gets the
/// chunk that holds it, on another thread than the sink's.
class TilePlaces {
 public:
  virtual ~TilePlaces() = default;
  virtual void place(const TilePlace& tile) = 0;
};

}  // namespace isobrick
