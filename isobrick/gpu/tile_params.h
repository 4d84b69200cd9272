#pragma once

#include <cstdint>

#include "isobrick/surface/cell_math.h"
#include "isobrick/surface/mesh.h"

// What the host hands to the extraction kernel. Plain data, no CUDA header.

namespace isobrick::gpu {

/// A page holds the samples of one tile: 32³, C order [z, y, x].
inline constexpr std::uint32_t kPageSamples = 32 * 32 * 32;
/// Rows (y, z) of the 33³ samples that the cells of a tile touch.
inline constexpr int kRowsOfTile = 33 * 33;

/// An active tile. `slot` is where it leaves its row table for later tiles.
struct TileItem {
  std::int32_t x, y, z;
  std::uint32_t slot;
};

inline constexpr std::uint32_t kNone = 0xffffffffu;

/// What later tiles ask of a tile: the number of the first own vertex of each
/// row, counted from the tile's first vertex, and where in the row those on
/// edges along y and along z begin: base | y << 17 | z << 23. One entry more
/// ends the last row.
struct alignas(16) RowTable {
  std::uint32_t rows[kRowsOfTile + 1];
  std::uint32_t number_base;  ///< mesh number of the tile's first vertex
  std::uint32_t ready;        ///< the epoch in which number_base was written
};

/// The running totals that tiles pass on in their order (decoupled look-back,
/// Merrill and Garland 2016): a value with a state in the two upper bits.
struct OrderState {
  unsigned long long vertices, triangles;
};

struct SurfaceTotals {
  unsigned long long vertices, triangles;
};

struct TileParams {
  const TileItem* items;
  const std::uint32_t* item_count;
  const void* pages;
  const std::uint32_t* page_of_tile;  ///< [z, y, x] of `tiles`; kNone: all fill value
  const std::uint32_t* slot_of_tile;  ///< the same; kNone: not active
  std::uint32_t fill_page;
  std::int32_t tiles[3];
  std::int32_t extent[3], roi_lo[3], roi_hi[3];  ///< samples
  double isovalue;
  float crossing;  ///< the isovalue as vertices are interpolated
  WorldMap world;
  bool diagonal;  ///< the map has no term off the diagonal
  RowTable* row_tables;
  OrderState* order;          ///< one an item, zeroed
  std::uint32_t* ticket;      ///< zeroed
  std::uint32_t epoch;        ///< never 0, new in each launch
  std::uint64_t number_base;  ///< vertices of the launches before
  Vec3f* positions;
  Vec3f* normals;
  Triangle* triangles;
  std::uint64_t vertex_capacity, triangle_capacity;
  SurfaceTotals* totals;
};

}  // namespace isobrick::gpu
