#pragma once

#include <cuda_runtime_api.h>

#include <isobrick/scalar.h>
#include "gpu/resident/pack_params.h"

namespace isobrick::inline v0::gpu {

/// Copies an array to tile blocks and their columns and finds the ranges of its tiles.
void launch_pack(ScalarType type, const PackParams& params, cudaStream_t stream);

}  // namespace isobrick::gpu
