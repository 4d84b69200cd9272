#pragma once

#include <cstdint>

#include <isobrick/lattice.h>
#include <isobrick/transform.h>

namespace isobrick::inline v0 {

/// More samples along an axis are not supported: meshes number tiles of 32 cells
/// with 21 bits an axis.
inline constexpr Index kMaxAxisSamples = Index{1} << 26;

/// One resolution of a store, 0 the finest.
struct LevelInfo {
  Lattice lattice;      ///< its samples and bricks
  Int3 shard;           ///< samples of a shard
  Transform transform;  ///< index space of this level to world space
  /// Bytes that each thread needs to decode a brick, beyond the brick and what it
  /// is encoded to: nothing unless a chunk holds several channels or times.
  std::uint64_t decode_extra = 0;
  /// Bytes of this level's shard indices that the reader keeps at most: all of a usual
  /// volume, bounded of a huge one.
  std::uint64_t index_bytes = 0;
  /// A checksum of the ranges of this level's blocks; 0 where there are none.
  std::uint32_t block_ranges_crc32c = 0;
};

}  // namespace isobrick
