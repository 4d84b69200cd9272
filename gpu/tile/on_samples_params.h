#pragma once

#include <cstdint>

#include "surface/border_normal.h"

// What the extraction kernel needs where a mesh has vertices on samples: to leave degenerate
// triangles out (surface/coincident_vertices.h) and to close the surface at the border
// (surface/cap.h). Plain data, no CUDA header.

namespace isobrick::inline v0::gpu {

/// Rows (y, z) of the 33³ samples that the cells of a tile touch.
inline constexpr int kRowsOfTile = 33 * 33;
/// The same with a layer of samples around: −1 … 33.
inline constexpr int kEdgeAround = 35;
inline constexpr int kRowsAround = kEdgeAround * kEdgeAround;
/// Cells along an edge with a layer around: −1 … 32.
inline constexpr int kCellsAround = 34;

/// What later tiles need of a tile's own vertices on samples. They follow those on its edges and
/// within its cells.
struct SampleTable {
  unsigned long long own[kRowsOfTile];  ///< bit x: the tile makes the vertex on sample x
  std::uint16_t before[kRowsOfTile];    ///< own ones in the rows before
  std::uint32_t inner;                  ///< vertices within the tile's cells
};

/// The slots of the tiles around an item, x + 3·y + 9·z, as TileLinks has them; kNone for those
/// that come later.
struct TileNeighbours {
  std::uint32_t slots[27];
};

/// What a block of threads notes of the tile that it works on.
struct SampleWork {
  /// Bit x + 1 of row (y + 1) + kEdgeAround · (z + 1): inside; coincident vertices, none where
  /// degenerate triangles stay.
  unsigned long long inside[kRowsAround], at[kRowsAround];
  /// Bit x + 1 of row (y + 1) + kCellsAround · (z + 1): the cell exists.
  unsigned long long there[kCellsAround * kCellsAround];
  unsigned long long used[kRowsOfTile];      ///< bit x: a triangle has a corner on sample x
  std::uint32_t cells[kRowsOfTile];          ///< active cells with a coincident vertex, in no list
  std::uint32_t triangles[kRowsOfTile];      ///< kept ones of such cells in the rows before
  std::uint32_t border[kRowsOfTile];         ///< cells at the border with a corner inside
  std::uint32_t border_before[kRowsOfTile];  ///< of these in the rows before
  std::uint32_t cap[kRowsOfTile];            ///< triangles of 32 of these each, in those before
  unsigned long long asked[kRowsOfTile];     ///< used samples that another tile may have made
  std::uint32_t asked_before[kRowsOfTile];   ///< of these in the rows before
  std::uint8_t owners[33 * kRowsOfTile];     ///< which tile makes a used vertex, if not this one
  std::uint32_t any_at, any_missing;         ///< whether there are such samples; such cells lack
  std::uint32_t own, kept, capped;           ///< vertices; triangles of cells, of the cap
  std::uint32_t all_border, all_asked;       ///< cells; samples
  std::uint32_t left_out;                    ///< triangles
  std::uint32_t other_owners;                ///< bits: tiles around that make used vertices
  std::uint32_t first_number[27];            ///< in the mesh, of their vertices on samples
  const SampleTable* tables[27];             ///< theirs
};

/// Blocks of threads that such a kernel has at most: each has a SampleWork.
inline constexpr int kMaxSampleBlocks = 512;

struct SampleParams {
  SampleWork* work;                  ///< one a block of threads
  SampleTable* tables;               ///< one a slot
  const TileNeighbours* neighbours;  ///< one an item where there are TileLinks
  unsigned long long* left_out;      ///< triangles, zeroed
  bool drop;                         ///< leaves degenerate triangles out
  bool cap;                          ///< closes the surface at the border
  bool below;                        ///< Inside::below
  bool may_have_nan;                 ///< else no sample is, whatever lies where none is needed
  bool none_reaches;                 ///< no sample of the type reaches the isovalue
  AxisNormals normals;               ///< of the border
};

}  // namespace isobrick::gpu
