#pragma once

#include <cstddef>
#include <cstdint>

#include <isobrick/lattice.h>
#include <isobrick/level_info.h>

namespace isobrick::inline v0 {

/// How a level's bricks are divided into shards.
struct ShardGrid {
  Int3 shards;            ///< of the level
  Int3 bricks_per_shard;  ///< also of a shard that the border cuts

  ShardGrid() = default;
  explicit ShardGrid(const LevelInfo& level)
      : shards(ceil_div(level.lattice.extent, level.shard)),
        bricks_per_shard(ceil_div(level.shard, level.lattice.brick)) {}

  /// Bricks of one shard.
  std::uint64_t shard_bricks() const {
    return static_cast<std::uint64_t>(volume(bricks_per_shard));
  }
  Int3 shard_of(Int3 brick) const {
    const Int3 n = bricks_per_shard;
    return {brick.x / n.x, brick.y / n.y, brick.z / n.z};
  }
  /// A brick's place in the index of its shard, C order [z, y, x].
  std::size_t place_in_shard(Int3 brick) const {
    const Int3 n = bricks_per_shard;
    return static_cast<std::size_t>(linear_index(brick - shard_of(brick) * n, n));
  }
};

}  // namespace isobrick
