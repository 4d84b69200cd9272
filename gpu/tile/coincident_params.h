#pragma once

#include <cstdint>

// What the extraction kernel needs to leave degenerate triangles out
// (surface/coincident_vertices.h). Plain data, no CUDA header.

namespace isobrick::inline v0::gpu {

/// Rows (y, z) of the 33³ samples that the cells of a tile touch.
inline constexpr int kRowsOfTile = 33 * 33;
/// The same with a layer of samples around: −1 … 33.
inline constexpr int kEdgeAround = 35;
inline constexpr int kRowsAround = kEdgeAround * kEdgeAround;

/// What later tiles need of a tile's own coincident vertices. They follow its vertices on edges.
struct SampleTable {
  unsigned long long own[kRowsOfTile];  ///< bit x: the tile makes the vertex on sample x
  std::uint16_t before[kRowsOfTile];    ///< own ones in the rows before
};

/// The slots of the tiles around an item, x + 3·y + 9·z, as TileLinks has them; kNone for those
/// that come later.
struct TileNeighbours {
  std::uint32_t slots[27];
};

/// What a block of threads notes of the tile that it works on.
struct CoincidentWork {
  /// Bit x + 1 of row (y + 1) + kEdgeAround · (z + 1).
  unsigned long long inside[kRowsAround], at[kRowsAround];
  unsigned long long used[kRowsOfTile];   ///< bit x: a triangle has a corner on sample x
  std::uint32_t cells[kRowsOfTile];       ///< active cells with a coincident vertex
  std::uint32_t triangles[kRowsOfTile];   ///< kept ones of such cells in the rows before
  std::uint8_t owners[33 * kRowsOfTile];  ///< which tile makes a used vertex, if not this one
  std::uint32_t any;                      ///< whether there are coincident vertices
  std::uint32_t own, kept, left_out;      ///< vertices; triangles
  std::uint32_t other_owners;             ///< bits: tiles around that make used vertices
  std::uint32_t first_number[27];         ///< in the mesh, of their vertices
  const SampleTable* tables[27];          ///< theirs
};

/// Blocks of threads that such a kernel has at most: each has a CoincidentWork.
inline constexpr int kMaxCoincidentBlocks = 512;

struct CoincidentParams {
  CoincidentWork* work;              ///< one a block of threads
  SampleTable* tables;               ///< one a slot
  const TileNeighbours* neighbours;  ///< one an item where there are TileLinks
  unsigned long long* left_out;      ///< triangles, zeroed
};

}  // namespace isobrick::gpu
