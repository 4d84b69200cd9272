#pragma once

#include <cuda_runtime_api.h>

#include <isobrick/scalar.h>
#include "gpu/search/search_params.h"

namespace isobrick::inline v0::gpu {

/// Finds the tiles that the isovalue stabs, in their order, numbered from 0.
void launch_search(ScalarType type, const SearchParams& params, cudaStream_t stream);

/// Ranges of all tiles from their samples: of the 33³ that its cells touch, as
/// far as the volume goes, NaN left out. Uses items, tile blocks, block_of_tile,
/// fill_tile_block, tiles and extent of `params`.
void launch_tile_ranges(ScalarType type, const TileParams& params, const std::int32_t* tiles,
                        std::uint32_t count, void* ranges, cudaStream_t stream);

/// Copies the samples at x = 0 of so many tile blocks, [z, y] of each.
void launch_first_columns(ScalarType type, const void* tile_blocks, std::uint32_t count,
                          void* columns, cudaStream_t stream);

}  // namespace isobrick::gpu
