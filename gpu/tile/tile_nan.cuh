#pragma once

#include "gpu/tile/tile_classify.cuh"
#include "gpu/tile/tile_count.cuh"

// Volumes that may hold NaN: cells with such a corner are left out, and edges with no
// other cell around them.

namespace isobrick::inline v0::gpu {

/// Which samples around a tile are not numbers or outside of the region of interest. Lies
/// where the lists will be, until the rows are counted.
struct NanRows {
  /// Bit x + 1 of row (y + 1) + kEdgeAround · (z + 1).
  unsigned long long rows[kRowsAround];

  __device__ unsigned long long at(int y, int z) const {
    return rows[(z + 1) * kEdgeAround + y + 1];
  }
};

__device__ inline NanRows& nan_rows_of(TileShared& s) {
  return *reinterpret_cast<NanRows*>(&s + 1);
}

/// The samples of a row around a tile, as a warp has them: lane i has sample i, and the first three
/// lanes those beside.
template <class T>
struct SamplesInRow {
  bool exists, beside_exists;  ///< in the region of interest
  T sample, beside;            ///< of those that exist

  /// Bit x + 1: sample x exists and is what `is` asks for. Whole warps.
  template <class Is>
  __device__ unsigned long long bits(Is&& is) const {
    const unsigned inner = __ballot_sync(kFullMask, exists && is(sample)),
                   outer = __ballot_sync(kFullMask, beside_exists && is(beside));
    return (outer & 1u) | static_cast<unsigned long long>(inner) << 1 |
           static_cast<unsigned long long>(outer >> 1 & 3u) << 33;
  }
};

/// Calls f(row, SamplesInRow) for the rows of samples −1 … 33, a row a warp.
template <int N, class T, class F>
__device__ inline void for_each_row_around(const TileShared& s, const TileParams& p, F&& f) {
  const auto lane = static_cast<int>(lane_id());
  const auto exists = [&](int axis, int at) {
    const int global = s.shape.origin[axis] + at;
    return global >= p.roi_lo[axis] && global < p.roi_hi[axis];
  };
  const auto load = [&](bool there, int x, int y, int z) {
    return there ? __ldg(sample_at<T>(s, block_at(x, y, z), x + 32 * y + 1024 * z)) : T{};
  };
  const int beside = lane == 0 ? -1 : 31 + lane;  // lanes 0, 1, 2: the samples beside the 32
  const bool row_exists = exists(0, lane), beside_exists = lane < 3 && exists(0, beside);
#pragma unroll 4  // loads that are on their way together
  for (auto row = static_cast<int>(warp_id()); row < kRowsAround; row += BlockConfig<N>::kWarps) {
    const int y = row % kEdgeAround - 1, z = row / kEdgeAround - 1;
    const bool here = exists(1, y) && exists(2, z);
    const bool in = here && row_exists, in_beside = here && beside_exists;
    f(row, SamplesInRow<T>{in, in_beside, load(in, lane, y, z), load(in_beside, beside, y, z)});
  }
}

/// What lies outside of the region of interest, where no sample is NaN.
template <int N>
__device__ inline void find_outside(TileShared& s, const TileParams& p) {
  NanRows& nan = nan_rows_of(s);
  // The samples from −1 to 33 that exist along an axis, as bits from 0 on.
  const auto exist = [&](int axis) {
    const int lo = ::max(p.roi_lo[axis] - s.shape.origin[axis], -1),
              hi = ::min(p.roi_hi[axis] - s.shape.origin[axis], 34);
    return hi <= lo ? 0ull : bit_span(lo + 1, hi);
  };
  const unsigned long long x = exist(0), y = exist(1), z = exist(2);
  for (unsigned row = own_thread(); row < kRowsAround; row += N) {
    const bool here = (y >> row % kEdgeAround & z >> row / kEdgeAround & 1u) != 0;
    nan.rows[row] = (here ? ~x : ~0ull) & ((1ull << kEdgeAround) - 1);
  }
}

/// Beside classify_samples().
template <int N, class T>
__device__ inline void find_nan(TileShared& s, const TileParams& p) {
  NanRows& nan = nan_rows_of(s);
  for_each_row_around<N, T>(s, p, [&](int row, const SamplesInRow<T>& samples) {
    const unsigned long long numbers = samples.bits([](T v) { return v == v; });
    if (lane_id() == 0) nan.rows[row] = ~numbers & ((1ull << kEdgeAround) - 1);
  });
}

/// Leaves out what touches NaN of a row's edges and cells.
__device__ inline void leave_out_nan(const NanRows& nan, int y, int z, RowEdges& e) {
  unsigned long long pair[3][2];  // samples y − 1 + j and the next, at z − 1 + k: or'ed
#pragma unroll
  for (int k = 0; k < 3; ++k) {
    const unsigned long long middle = nan.at(y, z - 1 + k);
    pair[k][0] = nan.at(y - 1, z - 1 + k) | middle;
    pair[k][1] = middle | nan.at(y + 1, z - 1 + k);
  }
  // Bit x + 1: cell (x, y − 1 + j, z − 1 + k) has no such corner.
  const auto good = [&](int j, int k) {
    const unsigned long long any = pair[k][j] | pair[k + 1][j];
    return ~(any | any >> 1);
  };
  const unsigned long long g00 = good(0, 0), g10 = good(1, 0), g01 = good(0, 1), g11 = good(1, 1);
  const unsigned long long along_y = g10 | g11, along_z = g01 | g11;
  // Bit x: a cell on either side of sample x.
  const unsigned long long at_y = along_y >> 1 | along_y, at_z = along_z >> 1 | along_z;
  e.x &= static_cast<std::uint32_t>((g00 | g10 | g01 | g11) >> 1);
  e.y &= static_cast<std::uint32_t>(at_y >> 1);
  e.z &= static_cast<std::uint32_t>(at_z >> 1);
  e.y_at_0 &= static_cast<std::uint32_t>(at_y & 1u);
  e.z_at_0 &= static_cast<std::uint32_t>(at_z & 1u);
  e.cells &= static_cast<std::uint32_t>(g11 >> 1);
}

}  // namespace isobrick::gpu
