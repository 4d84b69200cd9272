#pragma once

#include <cstdint>
#include <unordered_map>
#include <vector>

#include <isobrick/vec.h>
#include "core/tile_range.h"
#include "pipeline/pieces/neighbour_numbers.h"
#include "pipeline/pieces/piece_format.h"

namespace isobrick::inline v0 {

/// The last tile in the order that may use a vertex of this one, in a volume of `grid` tiles.
std::uint64_t last_asker(std::uint64_t code, Int3 grid);

/// The tiles of pieces before that pieces to come may name vertices of, and what the numbers of
/// such vertices become. Memory follows the surface between pieces that were read and others.
class OpenTiles {
 public:
  /// `extent` is of the samples.
  explicit OpenTiles(Int3 extent);

  /// Bytes that they take at most in a volume.
  static std::uint64_t bytes(Int3 extent);

  /// Forgets what pieces from this one on do not need. `neighbours` are listed in it.
  void begin_piece(const TileRange& tiles, const std::vector<PieceTile>& neighbours);
  /// Whether all of the neighbours were there.
  bool fits() const { return fits_; }
  /// Those of the piece.
  const NeighbourNumbers& numbers() const { return numbers_; }
  /// A tile of the piece; its first vertex has the number `first` in the mesh.
  void add(const PieceTile& tile, std::uint64_t first);

 private:
  struct Open {
    std::uint64_t first;
    std::uint32_t vertices;
  };

  Int3 grid_;
  std::uint64_t end_ = 0;  ///< of the piece
  std::unordered_map<std::uint64_t, Open> open_;
  NeighbourNumbers numbers_;
  bool fits_ = true;
};

}  // namespace isobrick
