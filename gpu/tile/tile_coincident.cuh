#pragma once

#include "gpu/tile/tile_classify.cuh"
#include "gpu/tile/tile_count.cuh"
#include "gpu/tile/tile_nan.cuh"

// Where degenerate triangles are left out: which coincident vertices a tile uses, which of them it
// makes, and which of its triangles are kept. The rules are those of surface/coincident_vertices.h.

namespace isobrick::inline v0::gpu {

__device__ inline CoincidentWork& coincident_work(const TileParams& p) {
  return p.coincident.work[blockIdx.x];
}

__device__ inline std::uint32_t popc_64(unsigned long long v) {
  return static_cast<std::uint32_t>(__popc(static_cast<std::uint32_t>(v)) +
                                    __popc(static_cast<std::uint32_t>(v >> 32)));
}
__device__ inline unsigned long long bits_below(int x) { return (1ull << x) - 1; }

/// The eight bits of a cell, each coordinate in −1 … 32, from rows around the tile.
__device__ inline std::uint32_t corners_at(const unsigned long long* rows, int x, int y, int z) {
  const unsigned long long* row = rows + (z + 1) * kEdgeAround + y + 1;
  const auto pair = [&](int step) { return static_cast<std::uint32_t>(row[step] >> (x + 1)) & 3u; };
  return pair(0) | pair(1) << 2 | pair(kEdgeAround) << 4 | pair(kEdgeAround + 1) << 6;
}

/// As coincident::vertex_on(): the corner that is a coincident vertex, or 8 + edge.
__device__ inline std::uint32_t vertex_on(std::uint32_t edge, std::uint32_t at) {
  const std::uint32_t axis = edge >> 2, i = edge & 1u, j = edge >> 1 & 1u;
  const std::uint32_t low = axis == 0 ? i << 1 | j << 2 : axis == 1 ? i | j << 2 : i | j << 1;
  const std::uint32_t high = low | 1u << axis;
  return at >> low & 1u ? low : at >> high & 1u ? high : 8u + edge;
}

/// What is kept of a cell, as bits: its triangles, and the coincident vertices that they use.
struct KeptTriangles {
  std::uint32_t triangles = 0, corners = 0;

  __device__ static KeptTriangles of(const CaseTable& cases, std::uint32_t index,
                                     std::uint32_t at) {
    KeptTriangles kept;
    const std::uint32_t n = cases.triangle_count[index];
    for (std::uint32_t t = 0; t < n; ++t) {
      const std::uint32_t edges = cases.triangles[5 * index + t];
      const std::uint32_t a = vertex_on(edges >> 3 & 15u, at), b = vertex_on(edges >> 7 & 15u, at),
                          c = vertex_on(edges >> 11 & 15u, at);
      if (a == b || b == c || c == a) continue;
      kept.triangles |= 1u << t;
      kept.corners |= (1u << a | 1u << b | 1u << c) & 0xffu;
    }
    return kept;
  }
};

/// Which samples around a tile are inside, and which are coincident vertices; notes whether any is.
template <int N, class T>
__device__ inline void find_coincident_samples(const TileShared& s, const TileParams& p,
                                               CoincidentWork& w, T value) {
  for_each_row_around<N, T>(s, p, [&](int row, const SamplesInRow<T>& samples) {
    const unsigned long long inside = samples.bits([&](T v) { return v >= value; }),
                             at = samples.bits([&](T v) { return v == value; });
    if (lane_id() > 0) return;
    w.inside[row] = inside;
    w.at[row] = at;
    if (at != 0) BlockWord(w.any).store(1, cuda::memory_order_relaxed);
  });
}

/// Goes through the active cells with coincident vertices: what they keep, and what that uses.
/// A row a warp.
template <int N>
__device__ inline void mark_used(const TileShared& s, const NanRows& missing, CoincidentWork& w) {
  const int x = static_cast<int>(lane_id());
  for (auto r = static_cast<int>(warp_id()); r < 32 * 32; r += BlockConfig<N>::kWarps) {
    const int y = r % 32, z = r / 32, row = 33 * z + y;
    const std::uint32_t at = corners_at(w.at, x, y, z);
    if (!__any_sync(kFullMask, at != 0)) continue;
    const std::uint32_t index = corners_at(w.inside, x, y, z);
    const std::uint32_t all = s.cases.triangle_count[index];
    const bool counts = at != 0 && all > 0 && corners_at(missing.rows, x, y, z) == 0;
    const KeptTriangles kept = counts ? KeptTriangles::of(s.cases, index, at) : KeptTriangles();
    const auto n = static_cast<std::uint32_t>(__popc(kept.triangles));
    const std::uint32_t cells = __ballot_sync(kFullMask, counts);
    const std::uint32_t triangles = warp_sum(n), left_out = warp_sum(counts ? all - n : 0);
#pragma unroll
    for (int pair = 0; pair < 4; ++pair) {
      const std::uint32_t low = __ballot_sync(kFullMask, (kept.corners >> 2 * pair & 1u) != 0),
                          high = __ballot_sync(kFullMask, (kept.corners >> 2 * pair & 2u) != 0);
      if (lane_id() == 0 && (low | high) != 0)
        atomicOr(&w.used[row + (pair & 1) + 33 * (pair >> 1)],
                 low | static_cast<unsigned long long>(high) << 1);
    }
    if (lane_id() > 0) continue;
    w.cells[row] = cells;
    w.triangles[row] = triangles;
    if (left_out > 0) atomicAdd(&w.left_out, left_out);
  }
}

/// Whether the tile at offset `a` of a tile comes before that at `b` in Morton order.
__device__ inline bool comes_before(const TileItem& tile, const int (&a)[3], const int (&b)[3]) {
  const std::int32_t at[3] = {tile.x, tile.y, tile.z};
  std::uint32_t most = 0;
  bool before = false;
#pragma unroll
  for (int axis = 2; axis >= 0; --axis) {
    const auto va = static_cast<std::uint32_t>(at[axis] + a[axis]),
               vb = static_cast<std::uint32_t>(at[axis] + b[axis]);
    const std::uint32_t differ = va ^ vb;
    // Whether its highest bit is above that of `most`.
    if (!(most < differ && most < (most ^ differ))) continue;
    most = differ;
    before = va < vb;
  }
  return before;
}

/// As first_tile_at() of the CPU: the tile, x + 3·y + 9·z, that makes the vertex on a sample.
__device__ inline std::uint32_t owner_of(const TileShared& s, const NanRows& missing,
                                         const CoincidentWork& w, int x, int y, int z) {
  const auto side = [](int cell) { return cell < 0 ? -1 : cell < 32 ? 0 : 1; };
  int first[3] = {0, 0, 0};
  for (int corner = 0; corner < 8; ++corner) {
    const int cx = x - (corner & 1), cy = y - (corner >> 1 & 1), cz = z - (corner >> 2);
    const int other[3] = {side(cx), side(cy), side(cz)};
    if (!comes_before(s.tile, other, first) || corners_at(missing.rows, cx, cy, cz) != 0) continue;
    const std::uint32_t index = corners_at(w.inside, cx, cy, cz), at = corners_at(w.at, cx, cy, cz);
    if (!(KeptTriangles::of(s.cases, index, at).corners >> corner & 1u)) continue;
    for (int axis = 0; axis < 3; ++axis) first[axis] = other[axis];
  }
  return static_cast<std::uint32_t>(13 + first[0] + 3 * first[1] + 9 * first[2]);
}

/// Divides the used vertices of each row into the tile's own and those of others. A row a warp.
template <int N>
__device__ inline void find_owners(const TileShared& s, const TileParams& p, const NanRows& missing,
                                   CoincidentWork& w) {
  SampleTable& table = p.coincident.tables[s.tile.slot];
  const auto lane = static_cast<int>(lane_id());
  for (auto row = static_cast<int>(warp_id()); row < kRowsOfTile; row += BlockConfig<N>::kWarps) {
    const auto z = static_cast<int>(z_of_row(static_cast<std::uint32_t>(row))), y = row - 33 * z;
    const bool on_plane = y == 0 || y == 32 || z == 0 || z == 32;
    const unsigned long long used = w.used[row];
    const unsigned long long asked = p.unwelded ? 0 : on_plane ? used : used & (1ull << 32 | 1u);
    unsigned long long own = used;
    // Whether another tile makes the vertex on sample x; notes which.
    const auto is_of_other = [&](bool is_asked, int x) {
      const std::uint32_t owner = is_asked ? owner_of(s, missing, w, x, y, z) : 13;
      if (owner == 13) return false;
      w.owners[33 * row + x] = static_cast<std::uint8_t>(owner);
      atomicOr(&w.other_owners, 1u << owner);
      return true;
    };
    if (asked != 0) {
      own &= ~static_cast<unsigned long long>(
          __ballot_sync(kFullMask, is_of_other((asked >> lane & 1u) != 0, lane)));
      const bool last = is_of_other(lane == 0 && (asked >> 32 & 1u) != 0, 32);
      if (__any_sync(kFullMask, last)) own &= ~(1ull << 32);
    }
    if (lane > 0) continue;
    table.own[row] = own;
    table.before[row] = static_cast<std::uint16_t>(popc_64(own));
  }
}

/// Replaces each row's count by that of the rows before; the count of all. One warp.
template <class Int>
__device__ inline std::uint32_t sum_rows(Int (&counts)[kRowsOfTile]) {
  constexpr int kEach = 35;
  static_assert(32 * kEach >= kRowsOfTile);
  const int begin = static_cast<int>(lane_id()) * kEach, end = ::min(begin + kEach, kRowsOfTile);
  std::uint32_t own = 0;
  for (int row = begin; row < end; ++row) own += counts[row];
  const std::uint32_t sum = warp_inclusive_sum(own);
  std::uint32_t before = sum - own;
  for (int row = begin; row < end; ++row) {
    const std::uint32_t count = counts[row];
    counts[row] = static_cast<Int>(before);
    before += count;
  }
  return __shfl_sync(kFullMask, sum, 31);
}

/// Between classify_tile() and count_tile(). `value` is that of coincident vertices.
template <int N, class T>
__device__ inline void find_coincident(TileShared& s, const TileParams& p, T value) {
  CoincidentWork& w = coincident_work(p);
  const NanRows& missing = nan_rows_of(s);
  if (threadIdx.x == 0) w.any = w.own = w.kept = w.left_out = w.other_owners = 0;
  __syncthreads();
  find_coincident_samples<N>(s, p, w, value);
  for (unsigned row = own_thread(); row < kRowsOfTile; row += N) {
    w.used[row] = 0;
    w.cells[row] = w.triangles[row] = 0;
  }
  __syncthreads();
  if (w.any == 0) return;
  mark_used<N>(s, missing, w);
  __syncthreads();
  find_owners<N>(s, p, missing, w);
  __syncthreads();
  if (warp_id() == BlockConfig<N>::kVertices) {
    const std::uint32_t own = sum_rows(p.coincident.tables[s.tile.slot].before);
    if (lane_id() == 0) w.own = own;
  }
  if (warp_id() == BlockConfig<N>::kTriangles) {
    const std::uint32_t kept = sum_rows(w.triangles);
    if (lane_id() == 0) {
      w.kept = kept;
      atomicAdd(p.coincident.left_out, w.left_out);
      __threadfence();  // before the block counts as done
    }
  }
}

/// Leaves out the edges with a coincident vertex at an end, and the cells with one.
__device__ inline void leave_out_coincident(const CoincidentWork& w, int y, int z, RowEdges& e) {
  const unsigned long long* row = w.at + (z + 1) * kEdgeAround + y + 1;
  const unsigned long long here = row[0] >> 1, along_y = here | row[1] >> 1,
                           along_z = here | row[kEdgeAround] >> 1;
  e.x &= ~static_cast<std::uint32_t>(here | here >> 1);
  e.y &= ~static_cast<std::uint32_t>(along_y >> 1);
  e.z &= ~static_cast<std::uint32_t>(along_z >> 1);
  e.y_at_0 &= ~static_cast<std::uint32_t>(along_y & 1u);
  e.z_at_0 &= ~static_cast<std::uint32_t>(along_z & 1u);
  e.cells &= ~w.cells[33 * z + y];
}

}  // namespace isobrick::gpu
