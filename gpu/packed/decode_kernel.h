#pragma once

#include <cuda_runtime_api.h>

#include <isobrick/scalar.h>
#include "gpu/packed/decode_params.h"

namespace isobrick::inline v0::gpu {

/// Decodes packed bricks, at most DecodeParams::kMax of them.
void launch_decode(ScalarType type, const DecodeParams& params, cudaStream_t stream);

/// Compares the samples of decoded bricks with their ranges.
void launch_range_check(ScalarType type, const RangeCheckParams& params, cudaStream_t stream);

}  // namespace isobrick::gpu
