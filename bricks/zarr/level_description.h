#pragma once

#include <cstdint>
#include <string>

#include <isobrick/level_info.h>
#include "bricks/zarr/array_metadata.h"
#include "bricks/zarr/volume_choice.h"

namespace isobrick::inline v0 {

/// All shard indices that a reader keeps may weigh so many bytes.
inline constexpr std::uint64_t kIndexCacheBytes = std::uint64_t{64} << 20;

/// What the index of a shard of so many bricks weighs among them.
std::uint64_t index_weight(std::uint64_t bricks);

/// What the metadata of a level's array mean. `where` names its file. Throws DamageError for an
/// impossible shape, Error for one that is too large.
LevelInfo describe_level(const ArrayMetadata& array, const VolumePlace& place,
                         const Transform& transform, const std::string& where);

}  // namespace isobrick
