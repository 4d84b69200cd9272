#pragma once

#include <isobrick/scalar.h>
#include "gpu/packed/decode_params.h"

namespace isobrick::emulated {

/// Decodes packed bricks on the CPU by the kernel.
void run_decode(ScalarType type, const gpu::DecodeParams& params, unsigned seed);

/// The kernel that compares decoded samples with ranges.
void run_range_check(ScalarType type, const gpu::RangeCheckParams& params, unsigned seed);

}  // namespace isobrick::emulated
