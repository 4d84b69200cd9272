#include "bricks/zarr/level_description.h"

#include <fmt/format.h>

#include <algorithm>
#include <span>

#include <isobrick/error.h>
#include "bricks/zarr/shard_grid.h"
#include "bricks/zarr/shard_index.h"

namespace isobrick::inline v0 {
namespace {

constexpr Index kMaxShards = Index{1} << 56;  // so that a shard and its level make one key

Int3 last_xyz(std::span<const Index> extents) {
  const std::size_t n = extents.size();
  return {extents[n - 1], extents[n - 2], extents[n - 3]};
}

/// Bytes that a reader keeps at most of a level with so many shards.
std::uint64_t max_index_bytes(std::uint64_t shards, std::uint64_t bricks_of_shard) {
  const std::uint64_t one = index_weight(bricks_of_shard);
  return shards <= kIndexCacheBytes / one ? shards * one : std::max(one, kIndexCacheBytes);
}

void check_extent(Int3 extent, const std::string& where) {
  if (!checked_volume(extent)) throw DamageError(where + ": the shape is out of bounds");
  for (int axis = 0; axis < 3; ++axis)
    if (extent[axis] > kMaxAxisSamples)
      throw Error(fmt::format("{}: more than {} samples along an axis are not supported", where,
                              kMaxAxisSamples));
}

}  // namespace

std::uint64_t index_weight(std::uint64_t bricks) {
  return 64 + ShardIndex::encoded_size(bricks, true);
}

LevelInfo describe_level(const ArrayMetadata& array, const VolumePlace& place,
                         const Transform& transform, const std::string& where) {
  LevelInfo level;
  level.lattice.extent = last_xyz(array.shape);
  level.lattice.brick = last_xyz(array.brick());
  level.lattice.type = array.type;
  level.shard = last_xyz(array.chunk);
  level.transform = transform;
  if (place.chunk_volumes > 1)
    level.decode_extra = 2 * place.chunk_volumes * level.lattice.brick_bytes();
  check_extent(level.lattice.extent, where);
  const ShardGrid grid(level);
  if (volume(grid.shards) > kMaxShards) throw Error(where + ": too many shards");
  if (array.sharding)
    level.index_bytes = max_index_bytes(static_cast<std::uint64_t>(volume(grid.shards)),
                                        grid.shard_bricks() * place.shard_volumes);
  return level;
}

}  // namespace isobrick
