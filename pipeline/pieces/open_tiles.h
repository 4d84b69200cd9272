#pragma once

#include <cstdint>
#include <unordered_map>
#include <vector>

#include <isobrick/vec.h>
#include "core/tile_range.h"
#include "pipeline/pieces/piece_format.h"

namespace isobrick::inline v0 {

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
  std::uint64_t neighbour_vertices() const { return neighbour_vertices_; }
  /// The number in the mesh of one of the neighbours' vertices.
  std::uint32_t number_of(std::uint32_t vertex) const;
  /// A tile of the piece; its first vertex has the number `first` in the mesh.
  void add(const PieceTile& tile, std::uint64_t first);

 private:
  struct Open {
    std::uint32_t first, vertices;
  };
  struct Neighbour {
    std::uint64_t begin;  ///< its first vertex in the piece
    std::uint32_t first;  ///< the same in the mesh
  };
  std::uint64_t last_asker(std::uint64_t code) const;

  Int3 last_tile_;
  std::uint64_t end_ = 0;  ///< of the piece
  std::unordered_map<std::uint64_t, Open> open_;
  std::vector<Neighbour> neighbours_;
  std::uint64_t neighbour_vertices_ = 0;
  bool fits_ = true;
};

}  // namespace isobrick
