#pragma once

#include <cstdint>

#include <isobrick/mesh.h>
#include "gpu/tile/on_samples_params.h"
#include "gpu/tile/trilinear_params.h"
#include "surface/cell_math.h"

// What the host hands to the extraction kernel. Plain data, no CUDA header.

namespace isobrick::inline v0::gpu {

/// A block holds the samples of one tile: 32³, C order [z, y, x].
inline constexpr std::uint32_t kTileBlockSamples = 32 * 32 * 32;
/// Samples of its first column, x = 0.
inline constexpr std::uint32_t kColumnSamples = 32 * 32;

/// An active tile. `slot` is where it leaves its row table for later tiles.
struct TileItem {
  std::int32_t x, y, z;
  std::uint32_t slot;
};

inline constexpr std::uint32_t kNone = 0xffffffffu;

/// What later tiles need of a tile: the number of the first own vertex of each
/// row, counted from the tile's first vertex, and where in the row those on
/// edges along y and along z begin: base | y << 17 | z << 23. One entry more
/// ends the last row. The table of a tile without vertices and cells is never read.
struct alignas(16) RowTable {
  std::uint32_t rows[kRowsOfTile + 1];
  /// The mesh number of the tile's first vertex, and above it the epoch in which it was
  /// written.
  unsigned long long base_and_epoch;
};

/// What a launch of its own must know of an item, where no tables of the whole grid are
/// kept: the row tables of the lower neighbours, at n − 1 for the one lower along x, y, z
/// where bits 0, 1, 2 of n are set; kNone where that has none.
struct TileLinks {
  /// The neighbour is of the same launch: it may have to be waited for.
  static constexpr std::uint32_t kSameLaunch = 0x80000000u;
  std::uint32_t before[6];
  std::uint32_t active_blocks;  ///< as in TileWork
};

/// The running totals that tiles pass on in their order (decoupled look-back,
/// Merrill and Garland 2016): a value with a state in the two upper bits.
struct OrderState {
  unsigned long long vertices, triangles;
};
/// The value of such a word.
inline constexpr unsigned long long kOrderMask = (1ull << 62) - 1;

struct SurfaceTotals {
  unsigned long long vertices, triangles;
  unsigned long long left_out;  ///< degenerate triangles
};

/// A word of a report in host memory. Each carries the number of its launch, so no word has to be
/// written after the others, for which the device would wait until those have crossed the bus.
struct LaunchWord {
  static constexpr int kValueBits = 40;

  static constexpr std::uint64_t of(std::uint64_t value, std::uint32_t launch) {
    return value | static_cast<std::uint64_t>(launch) << kValueBits;
  }
  static constexpr std::uint64_t value_of(std::uint64_t word) {
    return word & ((std::uint64_t{1} << kValueBits) - 1);
  }
  static constexpr bool is_about(std::uint64_t word, std::uint32_t launch) {
    return (word ^ of(0, launch)) >> kValueBits == 0;
  }
};
static_assert(LaunchWord::is_about(LaunchWord::of(5, (1u << 24) + 1), (1u << 24) + 1));
static_assert(!LaunchWord::is_about(LaunchWord::of(5, 1u << 24), (1u << 24) - 1));
static_assert(LaunchWord::value_of(LaunchWord::of((1ull << 40) - 1, 77)) == (1ull << 40) - 1);

/// What a launch reports: vertices and triangles made, active tiles, blocks that it wanted,
/// degenerate triangles left out.
struct LaunchReport {
  static constexpr int kVertices = 0, kTriangles = 1, kActiveTiles = 2, kBlocks = 3, kLeftOut = 4,
                       kWords = 5;
  std::uint64_t words[kWords];
};

/// How a launch reports what it has made and prepares the counters for the next launch.
struct LaunchEnd {
  LaunchReport* report;         ///< or null: the launch writes `totals` instead
  std::uint32_t launch;         ///< goes into the report
  const std::uint32_t* found;   ///< active tiles, as the search has counted them
  const std::uint32_t* blocks;  ///< that tiles of an array wanted; null: of no array
  std::uint32_t* done;          ///< zeroed
  std::uint32_t* zero;          ///< words that the next launch needs zeroed, also `done`
  std::uint32_t zero_words;
};

/// The cases as the kernel has them in shared memory: of each, its triangles, with three edges
/// times 8, 4 bits apart, and how many there are.
struct alignas(16) CaseTable {
  std::uint16_t triangles[256 * 5];
  std::uint8_t triangle_count[256];
};
/// For right-handed axes, or mirrored ones.
CaseTable make_case_table(bool mirrored);

/// What a kernel does beside the tables of cases, as bits.
enum class TileExtra : std::uint8_t {
  none = 0,
  trilinear = 1,   ///< follows the trilinear interpolant
  on_samples = 2,  ///< makes vertices on samples: leaves degenerate triangles out, or makes a cap
  both = 3,
};
constexpr bool is_trilinear(TileExtra extra) {
  return (static_cast<int>(extra) & static_cast<int>(TileExtra::trilinear)) != 0;
}
constexpr bool has_samples(TileExtra extra) {
  return (static_cast<int>(extra) & static_cast<int>(TileExtra::on_samples)) != 0;
}

struct TileParams {
  const TileItem* items;  ///< the active tiles in Morton order
  const std::uint32_t* item_count;
  const void* tile_blocks;
  /// [z, y, x] of `tiles`; kNone: all fill value. Null where block i + 1 is that of tile i.
  const std::uint32_t* block_of_tile;
  const std::uint32_t* slot_of_tile;  ///< the same; kNone: not active
  const TileLinks* links;             ///< one an item, instead of the two tables; or null
  bool tables_known;  ///< with links: a launch before has left all row tables as they will be
  bool unwelded;      ///< every tile owns all its edges
  std::uint32_t fill_tile_block;
  /// The samples at x = 0 of each block once more, [z, y], so that the last column of a tile
  /// is not read from as many lines as it has rows; null: they are read from the tile blocks.
  const void* columns;
  std::int32_t tiles[3];
  std::int32_t extent[3], roi_lo[3], roi_hi[3];  ///< samples
  double isovalue;
  WorldMap world;
  bool diagonal;  ///< the map has no term off the diagonal
  RowTable* row_tables;
  OrderState* order;                       ///< one an item, zeroed
  std::uint32_t* ticket;                   ///< zeroed
  std::uint32_t epoch;                     ///< never 0, new for each isovalue
  const unsigned long long* number_start;  ///< vertices of the launches before
  unsigned long long* number_end;          ///< and of this one, once it is over
  Vec3f* positions;
  Vec3f* normals;
  Triangle* triangles;
  std::uint64_t vertex_capacity, triangle_capacity;
  SurfaceTotals* totals;      ///< where there is no report
  SampleParams on_samples;    ///< of the kernels that make vertices on samples
  TrilinearParams trilinear;  ///< of those that follow the trilinear interpolant
  LaunchEnd end;
};

}  // namespace isobrick::gpu
