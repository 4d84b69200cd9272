#pragma once

#include <cstddef>

#include <isobrick/downsampling.h>
#include <isobrick/scalar.h>
#include <isobrick/transform.h>
#include <isobrick/vec.h>

namespace isobrick::inline v0 {

/// Halves every axis.
inline constexpr Int3 kHalveAll{2, 2, 2};

/// Samples of the next coarser level: `factors` (1 or 2 an axis) of this one become one, and
/// what is left at an odd end as well.
constexpr Int3 coarser_extent(Int3 extent, Int3 factors) { return ceil_div(extent, factors); }

/// Where the next coarser level of a lattice lies: a sample stands in the
/// middle of those it is made of, by `stride` at the first of them. An axis of one sample stays
/// as it is.
Transform coarser_transform(const Transform& transform, Int3 extent, Int3 factors,
                            Downsampling method = Downsampling::mean);

/// The axes to halve so that cells come nearer to cubes: those along which samples lie less
/// than √2 times as far apart as along the axis where they lie closest. Axes of one sample do
/// not count.
Int3 factors_by_spacing(const Transform& transform, Int3 extent);

/// Makes one sample of each box of `factors` samples: `in` is dense with `extent`, `out` dense
/// with coarser_extent(extent, factors). Where an odd extent ends, only the samples that exist
/// count. Parallel inside; the result does not depend on threads.
///
/// mean: of integers the exact mean, halves rounded up (towards +∞); of floats the sum in double
/// in a fixed order, rounded once. mode: of values that are equally frequent the smallest.
/// NaN is left out by all but `stride`; only where all are NaN (or, of a mean, infinities of both
/// signs are among them) the result is NaN.
void downsample(Downsampling method, ScalarType type, Int3 extent, Int3 factors,
                const std::byte* in, std::byte* out);

}  // namespace isobrick
