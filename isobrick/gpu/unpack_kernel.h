#pragma once

#include <cuda_runtime_api.h>

#include "isobrick/core/scalar.h"
#include "isobrick/gpu/tile_params.h"

namespace isobrick::gpu {

/// Tiles as they come from the host, and where the extraction wants them.
struct UnpackParams {
  const TileItem* items;
  const TileLinks* links;
  std::uint32_t count;
  const void* blocks;       ///< (33 + 2 · reach)³ samples of each tile, C order [z, y, x]
  std::size_t block_bytes;  ///< from one to the next
  int reach;                ///< layers of samples around a tile's 33³: 0 or 1
  std::int32_t extent[3];   ///< samples
  void* pages;
};

/// Lays the samples of streamed tiles out as pages. Those that no active block
/// needs become what they are as good as: the sample that all blocks of a tile share.
void launch_unpack(ScalarType type, const UnpackParams& params, cudaStream_t stream);

}  // namespace isobrick::gpu
