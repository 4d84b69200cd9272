#pragma once

#include "gpu/tile/tile_boundary.cuh"
#include "gpu/tile/tile_coincident.cuh"
#include "gpu/tile/tile_triangles.cuh"
#include "gpu/tile/tile_vertices.cuh"

// The vertices of a tile on coincident vertices, and the triangles of cells with such. They come
// behind the tile's others.

namespace isobrick::inline v0::gpu {

/// One warp, beside fetch_boundaries(): waits for the tiles that make vertices which this one uses.
__device__ inline void fetch_owners(const TileShared& s, const TileParams& p) {
  CoincidentWork& w = coincident_work(p);
  const auto n = static_cast<int>(lane_id());
  if (!(w.other_owners >> n & 1u)) return;
  std::uint32_t slot = 0;
  bool wait = true;
  if (p.links) {
    const std::uint32_t link = p.coincident.neighbours[s.item].slots[n];
    if (link == kNone) return;  // of a part: tiles before it are counted only, and write nothing
    slot = link & ~TileLinks::kSameLaunch;
    wait = (link & TileLinks::kSameLaunch) && !p.tables_known;
  } else {
    slot = slot_of(p, s.tile.x + n % 3 - 1, s.tile.y + n / 3 % 3 - 1, s.tile.z + n / 9 - 1);
  }
  const RowTable& table = p.row_tables[slot];
  DeviceWord word(p.row_tables[slot].base_and_epoch);
  unsigned long long seen = word.load(cuda::memory_order_acquire);
  while (wait && seen >> 32 != p.epoch) {
    __nanosleep(20);
    seen = word.load(cuda::memory_order_acquire);
  }
  w.first_number[n] = static_cast<std::uint32_t>(seen) + table.rows[kRowsOfTile];
  w.tables[n] = &p.coincident.tables[slot];
}

/// The number in the mesh of the vertex on sample `x` of a row, which the tile uses.
__device__ inline std::uint32_t number_of_sample(const TileShared& s, const TileParams& p,
                                                 const CoincidentWork& w, int row, int x) {
  const SampleTable& own = p.coincident.tables[s.tile.slot];
  if (own.own[row] >> x & 1u)
    return s.number_base + s.all_vertices + own.before[row] + popc_64(own.own[row] & bits_below(x));
  const int owner = w.owners[33 * row + x];
  // The place in the coordinates of the tile that makes it.
  const int there = row - 32 * (owner / 3 % 3 - 1) - 33 * 32 * (owner / 9 - 1);
  const SampleTable& table = *w.tables[owner];
  return w.first_number[owner] + table.before[there] +
         popc_64(table.own[there] & bits_below(x - 32 * (owner % 3 - 1)));
}

/// Towards the outside along the sample's first active edge: −x, +x, −y …
template <class T>
__device__ inline Vec3f first_active_edge(const TileShared& s, const TileParams& p, T value, int x,
                                          int y, int z) {
  Vec3f along{0, 0, 0};
  const int at[3] = {x, y, z};
  for (int axis = 0; axis < 3; ++axis)
    for (int side = -1; side <= 1; side += 2) {
      const int next = s.shape.origin[axis] + at[axis] + side;
      if (next < 0 || next >= p.extent[axis]) continue;
      const int nx = x + (axis == 0 ? side : 0), ny = y + (axis == 1 ? side : 0),
                nz = z + (axis == 2 ? side : 0);
      const T v = __ldg(sample_at<T>(s, block_at(nx, ny, nz), nx + 32 * ny + 1024 * nz));
      if (!(v < value)) continue;
      const auto outwards = static_cast<float>(-side);
      (axis == 0 ? along.x : axis == 1 ? along.y : along.z) = outwards;
      return along;
    }
  return along;
}

/// A row a warp.
template <int N, class T, bool Normals>
__device__ inline void write_sample_vertices(const TileShared& s, const TileParams& p, T value) {
  using Maker = VertexMaker<T>;
  const std::uint64_t first = s.vertex_base + s.all_vertices;
  if (s.extra_vertices == 0 || first + s.extra_vertices > p.vertex_capacity) return;
  const SampleTable& table = p.coincident.tables[s.tile.slot];
  const Maker maker{s, p, static_cast<typename Maker::R>(p.isovalue)};
  for (auto row = static_cast<int>(warp_id()); row < kRowsOfTile; row += BlockConfig<N>::kWarps) {
    const unsigned long long own = table.own[row];
    if (own == 0) continue;
    const auto z = static_cast<int>(z_of_row(static_cast<std::uint32_t>(row))), y = row - 33 * z;
    for (auto x = static_cast<int>(lane_id()); x < 33; x += 32) {
      if (!(own >> x & 1u)) continue;
      const std::uint64_t i = first + table.before[row] + popc_64(own & bits_below(x));
      store_once(p.positions[i], position_of(p, {static_cast<float>(s.shape.origin[0] + x),
                                                 static_cast<float>(s.shape.origin[1] + y),
                                                 static_cast<float>(s.shape.origin[2] + z)}));
      if constexpr (Normals)
        store_once(p.normals[i], p.world.unit_normal(
                                     maker.gradient(x, y, z, static_cast<typename Maker::R>(value)),
                                     first_active_edge(s, p, value, x, y, z)));
    }
  }
}

/// A row a warp, a cell a thread.
template <int N>
__device__ inline void write_kept_triangles(const TileShared& s, const TileParams& p) {
  const CoincidentWork& w = coincident_work(p);
  if (w.kept == 0 || s.triangle_base + s.all_triangles > p.triangle_capacity) return;
  Triangle* const first = p.triangles + s.triangle_base + (s.all_triangles - w.kept);
  const auto places = static_cast<std::uint32_t>(__cvta_generic_to_shared(s.places));
  const auto x = static_cast<int>(lane_id());
  for (auto row = static_cast<int>(warp_id()); row < kRowsOfTile; row += BlockConfig<N>::kWarps) {
    const std::uint32_t cells = w.cells[row];
    if (cells == 0) continue;
    const auto z = static_cast<int>(z_of_row(static_cast<std::uint32_t>(row))), y = row - 33 * z;
    const std::uint32_t index = corners_at(w.inside, x, y, z), at = corners_at(w.at, x, y, z);
    const KeptTriangles kept =
        cells >> x & 1u ? KeptTriangles::of(s.cases, index, at) : KeptTriangles();
    const auto count = static_cast<std::uint32_t>(__popc(kept.triangles));
    Triangle* to = first + w.triangles[row] + (warp_inclusive_sum(count) - count);
    for (std::uint32_t left = kept.triangles; left; left &= left - 1, ++to) {
      const auto t = static_cast<std::uint32_t>(__ffs(static_cast<int>(left)) - 1);
      const std::uint32_t edges = s.cases.triangles[5 * index + t];
      for (int c = 0; c < 3; ++c) {
        const std::uint32_t vertex = vertex_on(edges >> (3 + 4 * c) & 15u, at);
        const auto corner = static_cast<int>(vertex);
        const std::uint32_t number =
            vertex < 8
                ? number_of_sample(s, p, w, row + (corner >> 1 & 1) + 33 * (corner >> 2),
                                   x + (corner & 1))
                : number_on_edge(
                      s, 8 * (vertex - 8) | places_of(s, places, static_cast<std::uint32_t>(x)),
                      4 * static_cast<std::uint32_t>(row), low_bits(static_cast<std::uint32_t>(x)));
        __stcs(&(*to)[static_cast<std::size_t>(c)], number);
      }
    }
  }
}

template <int N, class T, bool Normals>
__device__ inline void write_coincident(const TileShared& s, const TileParams& p, T value) {
  write_sample_vertices<N, T, Normals>(s, p, value);
  write_kept_triangles<N>(s, p);
  __syncthreads();  // the first warp takes the next tile, and others still asked for this one
}

}  // namespace isobrick::gpu
