#pragma once

#include <cstddef>
#include <cstdint>

#include "gpu/tile/tile_params.h"

// What the host hands to the kernels that read an array of any strides. Plain data, no CUDA header.

namespace isobrick::inline v0::gpu {

/// An array, and how it is cut into tiles.
struct ArrayParams {
  const void* samples;      ///< sample (0, 0, 0)
  std::int64_t strides[3];  ///< samples from one to the next along x, y, z
  std::int32_t extent[3];   ///< samples
  std::int32_t tiles[3];
};

/// How an array is read, so that neighbouring threads read neighbouring bytes.
enum class ArrayOrder : std::uint8_t {
  vectors,  ///< x is without gaps, rows begin at multiples of 16 bytes
  along_x,  ///< neighbours along x are near each other
  along_y,  ///< neighbours along y are nearer
  along_z,
};

ArrayOrder array_order(const ArrayParams& array, std::size_t sample_bytes);

/// Where the ranges of tiles go.
struct ArrayRangeParams {
  ArrayParams array;
  std::uint32_t count;  ///< tiles
  /// Eight ranges a tile, C order [z, y, x]: those of its 32³ samples that are 0 along the axes of
  /// bits 0, 1, 2. A tile's cells touch those samples of the tiles above it.
  void* part_ranges;
  std::uint32_t* found_nan;  ///< becomes 1 where a sample is NaN
  // Joining the parts:
  const std::int32_t* order;  ///< x, y, z of all tiles, in the order of `ranges`
  void* ranges;               ///< of each tile's 33³
};

/// Blocks that tiles of an array have become.
struct ArrayBlockCounts {
  std::uint32_t wanted;  ///< more than there is room for: none of the last ones are copied
  std::uint32_t copied;
};

/// Which tiles of an array become tile blocks: those that active tiles look at and that are none
/// yet. Block 0 is no tile's.
struct ArrayLoadParams {
  ArrayParams array;
  const TileItem* items;  ///< the active tiles
  const std::uint32_t* found;
  std::uint32_t* item_count;  ///< those to extract: becomes 0 where there is no room
  int reach;                  ///< layers around the 33³ samples of a tile: 0 or 1
  std::uint32_t* block_of_tile;
  std::uint32_t* places;  ///< of the tiles of blocks 1, 2, …, in C order [z, y, x]
  ArrayBlockCounts* counts;
  std::uint32_t room;  ///< blocks
  void* tile_blocks;
  void* columns;  ///< TileParams::columns
};

}  // namespace isobrick::gpu
