#pragma once

#include <cstddef>
#include <cstdint>

#include <isobrick/lattice.h>
#include "packed/packed_format.h"

// What the host hands to the kernel that decodes packed bricks. Plain data, no CUDA header.

namespace isobrick::inline v0::gpu {

/// A packed brick whose header and table packed::BrickLayout has found good.
struct PackedOnDevice {
  const std::uint8_t* from;  ///< aligned to 4 bytes, and 8 bytes beyond its end can be read
  void* to;                  ///< samples of the whole brick, aligned to 32 bytes
  std::uint32_t palette;     ///< entries; 0: none
  bool is_plain;             ///< plain samples follow the header
  unsigned long long number;
};

/// The decoder may read so many bytes beyond a brick.
inline constexpr std::size_t kReadBeyond = 8;

/// Room for any packed brick of such a lattice, its checksum and what is read beyond it.
inline std::size_t packed_room(const Lattice& lattice) {
  constexpr std::size_t kAlign = 256;
  return (packed::max_packed_bytes(lattice.brick, lattice.sample_bytes()) + kReadBeyond + kAlign -
          1) /
         kAlign * kAlign;
}

/// The bricks of a launch.
struct DecodeParams {
  static constexpr std::uint32_t kMax = 64;
  PackedOnDevice bricks[kMax];
  std::uint32_t count;
  std::int32_t extent[3];  ///< samples of a brick
  std::int32_t blocks[3];  ///< blocks of 16³ of a brick
  std::uint32_t parts;     ///< blocks of threads a brick
  /// Gets the least number of a brick with a damaged block, unless it holds a lesser one.
  unsigned long long* failed;
};

/// A decoded brick, and what its samples must lie within.
struct RangedBrick {
  const void* samples;
  unsigned long long number;
  double lo, hi;
  std::int32_t inside[3];  ///< samples that are compared, from the first on
};

/// The bricks of a launch that compares samples with ranges.
struct RangeCheckParams {
  static constexpr std::uint32_t kMax = DecodeParams::kMax;
  RangedBrick bricks[kMax];
  std::uint32_t count;
  std::int32_t extent[3];      ///< samples of a brick
  unsigned long long* failed;  ///< as of DecodeParams
};

/// Blocks of a brick that a block of threads decodes.
inline constexpr int kBlocksOfPart = 16;

/// All but the bricks, for bricks of `extent` samples.
inline DecodeParams decode_params(Int3 extent) {
  const Int3 blocks = packed::blocks_of(extent);
  DecodeParams p{};
  for (int axis = 0; axis < 3; ++axis) {
    p.extent[axis] = static_cast<std::int32_t>(extent[axis]);
    p.blocks[axis] = static_cast<std::int32_t>(blocks[axis]);
  }
  p.parts = static_cast<std::uint32_t>((volume(blocks) + kBlocksOfPart - 1) / kBlocksOfPart);
  return p;
}

}  // namespace isobrick::gpu
