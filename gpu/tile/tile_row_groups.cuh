#pragma once

#include "gpu/tile/tile_shared.cuh"

// How the 33 × 33 rows of a tile are dealt out to warps: the first 32 rows of each plane are
// a group, so that a thread has the same y in all of them; the last rows of all planes are
// two more.

namespace isobrick::inline v0::gpu {

/// The first 32 rows of a plane.
struct PlaneRows {
  static constexpr bool kPlane = true;
  static constexpr int end = 33;
  int plane;

  /// Of row `i` of the group, which is that of lane i.
  __device__ int y(int i) const { return i; }
  __device__ int z(int) const { return plane; }
};
/// The last rows of planes. There may be less than 32.
struct LastRows {
  static constexpr bool kPlane = false;
  int first, end;

  __device__ static constexpr int y(int) { return 32; }
  __device__ int z(int i) const { return first + i; }
};
/// The row of the own lane.
template <class Rows>
struct OwnRow {
  int y, z, end;

  __device__ explicit OwnRow(Rows rows)
      : y(rows.y(static_cast<int>(lane_id()))),
        z(rows.z(static_cast<int>(lane_id()))),
        end(rows.end) {}
  __device__ bool exists() const { return Rows::kPlane || z < end; }
  __device__ int row() const { return 33 * z + y; }
};

/// Calls f(PlaneRows) or f(LastRows) for the row groups of this warp. Loops, so that the code of
/// each kind is there once: warps in different steps share the instruction cache. `BesideFirst`:
/// the first warp of several has something else to do and gets no planes, but the last rows.
template <int N, bool BesideFirst = false, class F>
__device__ inline void for_each_row_group(F&& f) {
  auto group = static_cast<int>(uniform(warp_id()));
  constexpr bool kBeside = BesideFirst && BlockConfig<N>::kWarps > 1;
  constexpr int kStep = BlockConfig<N>::kWarps - (kBeside ? 1 : 0);
  if (kBeside) group = group == 0 ? 33 : group - 1;
#pragma unroll 1
  for (; group < 33; group += kStep) f(PlaneRows{group});
  if (kBeside && uniform(warp_id()) != 0) return;
#pragma unroll 1
  for (; group < kRowGroups; group += kBeside ? 1 : kStep) f(LastRows{32 * (group - 33), 33});
}

}  // namespace isobrick::gpu
