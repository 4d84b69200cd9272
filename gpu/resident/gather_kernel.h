#pragma once

#include <cuda_runtime_api.h>

#include <isobrick/scalar.h>
#include "gpu/resident/gather_params.h"

namespace isobrick::inline v0::gpu {

/// Copies the samples of tiles from their bricks to their tile blocks.
void launch_gather(ScalarType type, const GatherParams& params, cudaStream_t stream);

}  // namespace isobrick::gpu
