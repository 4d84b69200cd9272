#pragma once

#include "gpu/tile/tile_cap.cuh"
#include "gpu/tile/tile_coincident.cuh"
#include "gpu/tile/tile_trilinear.cuh"

// The vertices of a tile on samples: coincident ones where degenerate triangles are left out, and
// those of caps. Which the tile uses, and which tile makes them. The rules are those of
// surface/sample_vertices.h.

namespace isobrick::inline v0::gpu {

/// The corners of a cell that triangles of the surface have coincident vertices on.
template <class T, bool Trilinear>
__device__ inline std::uint32_t surface_corners(const TileShared& s, const TileParams& p,
                                                const SampleWork& w, int x, int y, int z) {
  const std::uint32_t at = corners_at(w.at, x, y, z);
  if (at == 0 || !exists(w, x, y, z)) return 0;
  const std::uint32_t index = corners_at(w.inside, x, y, z);
  if constexpr (Trilinear) {
    const TopologyTables& tables = *p.trilinear.tables;
    double d[8];
    load_cell<T>(s, p, x, y, z, d);
    const CellPatch& patch =
        tables.patches[cell_topology::patch_of(tables, static_cast<int>(index), d)];
    return kept_of_patch(tables, patch, at).corners;
  } else {
    return kept_of_case(s.cases, index, at).corners;
  }
}

/// Whether triangles of the cap have a vertex on a corner of a cell; without coincident vertices
/// the sample is inside, and so it is where there is a border face.
template <class T, bool Trilinear>
__device__ inline bool cap_has(const TileShared& s, const TileParams& p, const SampleWork& w, int x,
                               int y, int z, int corner) {
  if (!exists(w, x, y, z)) return false;
  const auto lacks = [&](int axis) {
    const int step = corner >> axis & 1 ? 1 : -1;
    return !exists(w, x + (axis == 0 ? step : 0), y + (axis == 1 ? step : 0),
                   z + (axis == 2 ? step : 0));
  };
  if (!lacks(0) && !lacks(1) && !lacks(2)) return false;
  if (!w.any_at || corners_at(w.at, x, y, z) == 0) return true;
  std::uint32_t corners = 0;
  for_each_cap_face<T, Trilinear>(
      s, p, w, x, y, z,
      [&](int, std::uint32_t, std::uint32_t, const KeptOfCell& kept) { corners |= kept.corners; });
  return (corners >> corner & 1u) != 0;
}

/// Whether a layer of cells around the tile is not all in the region of interest.
__device__ inline bool is_near_border(const TileShared& s, const TileParams& p) {
  bool near = false;
#pragma unroll
  for (int axis = 0; axis < 3; ++axis)
    near = near || s.shape.origin[axis] - 1 < p.roi_lo[axis] ||
           s.shape.origin[axis] + 34 > p.roi_hi[axis];
  return near;
}

/// Which samples around a tile are inside, and which are coincident vertices; empties the notes.
/// `value` is that of coincident vertices. Between classify_tile() and all that counts.
template <int N, class T>
__device__ inline void find_samples(TileShared& s, const TileParams& p, T value) {
  SampleWork& w = sample_work(p);
  const SampleParams& params = p.on_samples;
  if (threadIdx.x == 0)
    w.any_at = w.any_missing = w.own = w.kept = w.capped = w.left_out = w.other_owners = 0;
  for (unsigned row = own_thread(); row < kRowsOfTile; row += N) {
    w.used[row] = 0;
    w.cells[row] = w.triangles[row] = w.cap[row] = 0;
    if (params.none_reaches) s.rows[row] = {0, 0};
  }
  __syncthreads();
  if (!params.drop && !params.may_have_nan && !is_near_border(s, p)) return;
  for_each_row_around<N, T>(s, p, [&](int row, const SamplesInRow<T>& samples) {
    const unsigned long long inside = samples.bits([&](T v) { return v >= value; }),
                             at = samples.bits([&](T v) { return v == value; });
    if (lane_id() > 0) return;
    w.inside[row] = params.none_reaches ? 0 : inside;
    w.at[row] = params.drop ? at : 0;
    if (params.drop && at != 0) BlockWord(w.any_at).store(1, cuda::memory_order_relaxed);
  });
  find_cells_there<N>(nan_rows_of(s), w);
  __syncthreads();
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
template <class T, bool Trilinear>
__device__ inline std::uint32_t owner_of(const TileShared& s, const TileParams& p,
                                         const SampleWork& w, int x, int y, int z) {
  const auto side = [](int cell) { return cell < 0 ? -1 : cell < 32 ? 0 : 1; };
  int first[3] = {0, 0, 0};
  for (int corner = 0; corner < 8; ++corner) {
    const int cx = x - (corner & 1), cy = y - (corner >> 1 & 1), cz = z - (corner >> 2);
    const int other[3] = {side(cx), side(cy), side(cz)};
    if (!comes_before(s.tile, other, first)) continue;
    const bool makes =
        (w.any_at && (surface_corners<T, Trilinear>(s, p, w, cx, cy, cz) >> corner & 1u)) ||
        (p.on_samples.cap && w.any_missing && cap_has<T, Trilinear>(s, p, w, cx, cy, cz, corner));
    if (!makes) continue;
    for (int axis = 0; axis < 3; ++axis) first[axis] = other[axis];
  }
  return static_cast<std::uint32_t>(13 + first[0] + 3 * first[1] + 9 * first[2]);
}

/// Divides the used vertices of each row into the tile's own and those of others.
template <int N, class T, bool Trilinear>
__device__ inline void find_owners(const TileShared& s, const TileParams& p, SampleWork& w) {
  SampleTable& table = p.on_samples.tables[s.tile.slot];
  for (auto row = static_cast<int>(own_thread()); row < kRowsOfTile; row += N) {
    const auto z = static_cast<int>(z_of_row(static_cast<std::uint32_t>(row))), y = row - 33 * z;
    const bool on_plane = y == 0 || y == 32 || z == 0 || z == 32;
    const unsigned long long used = w.used[row];
    const unsigned long long asked = p.unwelded ? 0 : on_plane ? used : used & (1ull << 32 | 1u);
    table.own[row] = used;
    w.asked[row] = asked;
    w.asked_before[row] = popc_64(asked);
  }
  __syncthreads();
  if (warp_id() == 0) {
    const std::uint32_t all = sum_rows(w.asked_before);
    if (lane_id() == 0) w.all_asked = all;
  }
  __syncthreads();
  for_each_bit<N>(w.asked, w.asked_before, w.all_asked,
                  [&](std::uint32_t, bool is_asked, int row, int x) {
                    if (!is_asked) return;
                    const auto z = static_cast<int>(z_of_row(static_cast<std::uint32_t>(row)));
                    const std::uint32_t owner = owner_of<T, Trilinear>(s, p, w, x, row - 33 * z, z);
                    if (owner == 13) return;
                    w.owners[33 * row + x] = static_cast<std::uint8_t>(owner);
                    atomicOr(&w.other_owners, 1u << owner);
                    atomicAnd(&table.own[row], ~(1ull << x));
                  });
  __syncthreads();
  for (auto row = static_cast<int>(own_thread()); row < kRowsOfTile; row += N)
    table.before[row] = static_cast<std::uint16_t>(popc_64(table.own[row]));
}

/// Between find_samples() and count_tile(), and after find_patched() where that is called.
template <int N, class T, bool Trilinear>
__device__ inline void find_on_samples(TileShared& s, const TileParams& p) {
  SampleWork& w = sample_work(p);
  const bool capped = p.on_samples.cap && w.any_missing;
  if (!w.any_at && !capped) return;
  if (w.any_at) mark_coincident<N, Trilinear>(s, p, w);
  if (capped) count_cap<N, T, Trilinear>(s, p, w);
  __syncthreads();
  find_owners<N, T, Trilinear>(s, p, w);
  __syncthreads();
  if (warp_id() == BlockConfig<N>::kVertices) {
    SampleTable& table = p.on_samples.tables[s.tile.slot];
    const std::uint32_t own = sum_rows(table.before);
    if (lane_id() == 0) {
      w.own = own;
      table.inner = Trilinear ? trilinear_work(p).own_vertices : 0;
    }
  }
  if (warp_id() == BlockConfig<N>::kTriangles) {
    const std::uint32_t kept = sum_rows(w.triangles), cap = sum_rows(w.cap);
    if (lane_id() == 0) {
      w.kept = kept;
      w.capped = cap;
      if (w.left_out > 0) atomicAdd(p.on_samples.left_out, w.left_out);
      __threadfence();  // before the block counts as done
    }
  }
}

}  // namespace isobrick::gpu
