#pragma once

#include <cstdint>

#include "gpu/tile/tile_params.h"

namespace isobrick::inline v0::gpu {

/// Streamed tiles whose tile blocks lie together, and samples of such a group: their own
/// tile blocks, and what they share for the samples around them (streamed_blocks.cuh).
inline constexpr std::uint32_t kTilesOfBlockGroup = 8;
inline constexpr std::uint32_t kBlockGroupSamples =
    (kTilesOfBlockGroup + 4) * kTileBlockSamples + 3 * 4096;

}  // namespace isobrick::gpu
