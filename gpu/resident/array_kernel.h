#pragma once

#include <cuda_runtime_api.h>

#include <isobrick/scalar.h>
#include "gpu/resident/array_params.h"

namespace isobrick::inline v0::gpu {

/// Finds the ranges of the parts of tiles of an array.
void launch_part_ranges(ScalarType type, const ArrayRangeParams& params, cudaStream_t stream);
/// Joins these to the ranges of tiles.
void launch_join_ranges(ScalarType type, const ArrayRangeParams& params, cudaStream_t stream);

/// Makes tile blocks of the tiles that active tiles look at and that are none yet.
void launch_load(ScalarType type, const ArrayLoadParams& params, cudaStream_t stream);

}  // namespace isobrick::gpu
