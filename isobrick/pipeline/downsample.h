#pragma once

#include <cstddef>

#include "isobrick/core/scalar.h"
#include "isobrick/core/transform.h"
#include "isobrick/core/vec.h"

namespace isobrick {

/// Samples of the next coarser level: half as many along each axis, rounded up.
constexpr Int3 half_extent(Int3 extent) { return ceil_div(extent, {2, 2, 2}); }

/// Where the next coarser level of a lattice lies: a sample stands in the
/// middle of the two it averages. An axis of one sample stays as it is.
Transform half_transform(const Transform& transform, Int3 extent);

/// Averages 2×2×2 samples: `in` is dense with `extent`, `out` dense with
/// half_extent(extent). Where an odd extent ends the mean is over the samples
/// that exist. Parallel inside; the result does not depend on threads.
///
/// Integers: the exact mean, halves rounded up (towards +∞). Floats: the sum is
/// taken in double in a fixed order and rounded once. NaN is left out of the
/// mean; only eight NaN make a NaN (or infinities of both signs).
void downsample(ScalarType type, Int3 extent, const std::byte* in, std::byte* out);

}  // namespace isobrick
