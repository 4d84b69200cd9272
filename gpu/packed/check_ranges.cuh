#pragma once

#include "gpu/packed/decode_params.h"

// The kernel that compares the samples of decoded bricks with their stored ranges: a brick of
// another place or store has a right checksum and makes a wrong mesh.

namespace isobrick::inline v0::gpu {

inline constexpr unsigned kCheckThreads = 256, kChecksOfBrick = 8;

/// Some blocks of threads a brick, a warp a row. NaN lies within every range.
template <class T>
__global__ void __launch_bounds__(kCheckThreads)
    check_ranges(const __grid_constant__ RangeCheckParams p) {
  const RangedBrick& brick = p.bricks[blockIdx.x / kChecksOfBrick];
  const auto* const samples = static_cast<const T*>(brick.samples);
  constexpr int kWarps = kCheckThreads / 32;
  const int warp = static_cast<int>(blockIdx.x % kChecksOfBrick * kWarps + threadIdx.x / 32);
  const int rows = brick.inside[1] * brick.inside[2];
  bool outside = false;
  for (int row = warp; row < rows; row += kWarps * static_cast<int>(kChecksOfBrick)) {
    const int y = row % brick.inside[1], z = row / brick.inside[1];
    const T* const from = samples + (std::int64_t{z} * p.extent[1] + y) * p.extent[0];
    for (int x = static_cast<int>(threadIdx.x % 32); x < brick.inside[0]; x += 32) {
      const auto sample = static_cast<double>(from[x]);
      outside = outside || sample < brick.lo || sample > brick.hi;
    }
  }
  if (outside) atomicMin(p.failed, brick.number);
}

}  // namespace isobrick::gpu
