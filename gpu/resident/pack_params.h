#pragma once

#include <cstddef>
#include <cstdint>

// What the host hands to the kernels that copy an array to tile blocks. Plain data, no CUDA header.

namespace isobrick::inline v0::gpu {

/// An array and the tile blocks of a volume that it becomes. Block 0 is not touched, block i + 1 is
/// that of tile i in C order [z, y, x].
struct PackParams {
  const void* samples;      ///< sample (0, 0, 0)
  std::int64_t strides[3];  ///< samples from one to the next along x, y, z
  std::int32_t extent[3];   ///< samples
  std::int32_t tiles[3];
  const std::int32_t* order;  ///< x, y, z of all tiles, in the order of `ranges`
  std::uint32_t count;        ///< tiles
  void* tile_blocks;
  void* columns;  ///< TileParams::columns
  /// Eight ranges a tile, in the order of the blocks: those of its samples that are 0 along the
  /// axes of bits 0, 1, 2. A tile's cells touch those samples of the tiles above it.
  void* part_ranges;
  void* ranges;              ///< of each tile's 33³, in the order of `order`
  std::uint32_t* found_nan;  ///< becomes 1 where a sample is NaN
};

/// How an array is read.
enum class PackOrder : std::uint8_t {
  vectors,  ///< x is without gaps, rows begin at multiples of 16 bytes
  along_x,  ///< neighbours along x are near each other
  along_y,  ///< neighbours along y are nearer
  along_z,
};

/// The order in which neighbouring threads read neighbouring bytes.
PackOrder pack_order(const PackParams& params, std::size_t sample_bytes);

}  // namespace isobrick::gpu
