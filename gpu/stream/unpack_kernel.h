#pragma once

#include <cuda_runtime_api.h>

#include <isobrick/scalar.h>
#include "gpu/stream/unpack_params.h"

namespace isobrick::inline v0::gpu {

/// Lays the samples of streamed tiles out as tile blocks. Those that no active block
/// needs are replaced by the sample that all blocks of a tile share, which changes no result.
void launch_unpack(ScalarType type, const UnpackParams& params, cudaStream_t stream);

}  // namespace isobrick::gpu
