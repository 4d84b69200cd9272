#pragma once

#include <cstdint>

#include "isobrick/gpu/tile_params.h"

namespace isobrick::gpu {

/// Streamed tiles whose pages lie together, and samples of such a group: their own pages,
/// and what they share for the samples around them (streamed_pages.cuh).
inline constexpr std::uint32_t kTilesOfPageGroup = 8;
inline constexpr std::uint32_t kPageGroupSamples =
    (kTilesOfPageGroup + 4) * kPageSamples + 3 * 4096;

}  // namespace isobrick::gpu
