#pragma once

#include "gpu/tile/tile_boundary.cuh"
#include "gpu/tile/tile_on_samples.cuh"
#include "gpu/tile/tile_triangles.cuh"
#include "gpu/tile/tile_vertices.cuh"

// The vertices of a tile on samples, and the triangles that have corners there: of cells with a
// coincident vertex, and of the cap. They come behind the tile's others.

namespace isobrick::inline v0::gpu {

/// One warp, beside fetch_boundaries(): waits for the tiles that make vertices which this one uses.
__device__ inline void fetch_owners(const TileShared& s, const TileParams& p) {
  SampleWork& w = sample_work(p);
  const auto n = static_cast<int>(lane_id());
  if (!(w.other_owners >> n & 1u)) return;
  std::uint32_t slot = 0;
  bool wait = true;
  if (p.links) {
    const std::uint32_t link = p.on_samples.neighbours[s.item].slots[n];
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
  w.tables[n] = &p.on_samples.tables[slot];
  w.first_number[n] =
      static_cast<std::uint32_t>(seen) + table.rows[kRowsOfTile] + w.tables[n]->inner;
}

/// The tile's vertices before its own on samples.
__device__ inline std::uint32_t before_samples(const TileShared& s, const SampleWork& w) {
  return s.all_vertices + s.extra_vertices - w.own;
}

/// The number in the mesh of the vertex on sample `x` of a row, which the tile uses.
__device__ inline std::uint32_t number_of_sample(const TileShared& s, const TileParams& p,
                                                 const SampleWork& w, int row, int x) {
  const SampleTable& own = p.on_samples.tables[s.tile.slot];
  if (own.own[row] >> x & 1u)
    return s.number_base + before_samples(s, w) + own.before[row] +
           popc_64(own.own[row] & bits_below(x));
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

/// Whether triangles of the surface meet at a sample, and not only the cap's.
template <class T, bool Trilinear>
__device__ inline bool is_of_surface(const TileShared& s, const TileParams& p, const SampleWork& w,
                                     int x, int y, int z) {
  if (!p.on_samples.cap || !w.any_missing) return true;
  if (!w.any_at) return false;
  for (int corner = 0; corner < 8; ++corner)
    if (surface_corners<T, Trilinear>(s, p, w, x - (corner & 1), y - (corner >> 1 & 1),
                                      z - (corner >> 2)) >>
            corner &
        1u)
      return true;
  return false;
}

/// A row a warp.
template <int N, class T, bool Normals, bool Trilinear>
__device__ inline void write_sample_vertices(const TileShared& s, const TileParams& p, T value) {
  using Maker = VertexMaker<T>;
  const SampleWork& w = sample_work(p);
  if (w.own == 0 || s.vertex_base + s.all_vertices + s.extra_vertices > p.vertex_capacity) return;
  const std::uint64_t first = s.vertex_base + before_samples(s, w);
  const SampleTable& table = p.on_samples.tables[s.tile.slot];
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
      if constexpr (Normals) {
        const auto normal = [&] {
          if (!is_of_surface<T, Trilinear>(s, p, w, x, y, z))
            return border_normal(p.on_samples.normals, x, y, z,
                                 [&](int cx, int cy, int cz) { return exists(w, cx, cy, cz); });
          return p.world.unit_normal(maker.gradient(x, y, z, static_cast<typename Maker::R>(value)),
                                     first_active_edge(s, p, value, x, y, z));
        };
        store_once(p.normals[i], normal());
      }
    }
  }
}

/// The numbers in the mesh of the vertices of a row's cells, as vertex_on() names them.
struct VertexNumbers {
  const TileShared& s;
  const TileParams& p;
  const SampleWork& w;
  std::uint32_t of_x, mask;
  int row, x;

  __device__ VertexNumbers(const TileShared& tile, const TileParams& params, int of_row, int at)
      : s(tile), p(params), w(sample_work(params)), row(of_row), x(at) {
    const auto ux = static_cast<std::uint32_t>(x);
    of_x = places_of(s, static_cast<std::uint32_t>(__cvta_generic_to_shared(s.places)), ux);
    mask = low_bits(ux);
  }
  __device__ std::uint32_t operator()(std::uint32_t vertex) const {
    const auto corner = static_cast<int>(vertex);
    if (vertex < 8)
      return number_of_sample(s, p, w, row + (corner >> 1 & 1) + 33 * (corner >> 2),
                              x + (corner & 1));
    return number_on_edge(s, 8 * (vertex - 8) | of_x, 4 * static_cast<std::uint32_t>(row), mask);
  }
};

/// A row a warp, a cell a thread.
template <int N>
__device__ inline void write_kept_triangles(const TileShared& s, const TileParams& p,
                                            std::uint32_t behind) {
  const SampleWork& w = sample_work(p);
  if (w.kept == 0 || s.triangle_base + s.all_triangles > p.triangle_capacity) return;
  Triangle* const first = p.triangles + s.triangle_base + (s.all_triangles - behind - w.kept);
  const auto x = static_cast<int>(lane_id());
  for (auto row = static_cast<int>(warp_id()); row < kRowsOfTile; row += BlockConfig<N>::kWarps) {
    const std::uint32_t cells = w.cells[row];
    if (cells == 0) continue;
    const auto z = static_cast<int>(z_of_row(static_cast<std::uint32_t>(row))), y = row - 33 * z;
    const std::uint32_t index = corners_at(w.inside, x, y, z), at = corners_at(w.at, x, y, z);
    const KeptOfCell kept = cells >> x & 1u ? kept_of_case(s.cases, index, at) : KeptOfCell();
    const auto count = static_cast<std::uint32_t>(__popc(kept.triangles));
    Triangle* to = first + w.triangles[row] + (warp_inclusive_sum(count) - count);
    const VertexNumbers number(s, p, row, x);
    for (std::uint32_t left = kept.triangles; left; left &= left - 1, ++to) {
      const auto t = static_cast<std::uint32_t>(__ffs(static_cast<int>(left)) - 1);
      const std::uint32_t edges = s.cases.triangles[5 * index + t];
      for (int c = 0; c < 3; ++c)
        __stcs(&(*to)[static_cast<std::size_t>(c)],
               number(vertex_on(edges >> (3 + 4 * c) & 15u, at)));
    }
  }
}

/// The tile's last triangles. They face away from the cells, so only left-handed axes turn them
/// round.
template <int N, class T, bool Trilinear>
__device__ inline void write_cap_triangles(const TileShared& s, const TileParams& p) {
  const SampleWork& w = sample_work(p);
  if (w.capped == 0 || s.triangle_base + s.all_triangles > p.triangle_capacity) return;
  Triangle* const first = p.triangles + s.triangle_base + (s.all_triangles - w.capped);
  const int second = p.world.mirrored != p.on_samples.below ? 2 : 1;
  for_each_bit<N>(
      w.border, w.border_before, w.all_border,
      [&](std::uint32_t group, bool is_cell, int row, int x) {
        const auto z = static_cast<int>(z_of_row(static_cast<std::uint32_t>(row))),
                   y = row - 33 * z;
        std::uint32_t count = 0;
        if (is_cell)
          for_each_cap_face<T, Trilinear>(
              s, p, w, x, y, z, [&](int, std::uint32_t, std::uint32_t, const KeptOfCell& kept) {
                count += static_cast<std::uint32_t>(__popc(kept.triangles));
              });
        __syncwarp();
        Triangle* to = first + w.cap[group] + (warp_inclusive_sum(count) - count);
        if (count == 0) return;
        const VertexNumbers number(s, p, row, x);
        for_each_cap_face<T, Trilinear>(
            s, p, w, x, y, z,
            [&](int face, std::uint32_t polygon, std::uint32_t at, const KeptOfCell& kept) {
              for (std::uint32_t left = kept.triangles; left; left &= left - 1, ++to) {
                const auto t = static_cast<std::uint32_t>(__ffs(static_cast<int>(left)) - 1);
                for (int c = 0; c < 3; ++c)
                  __stcs(&(*to)[static_cast<std::size_t>(c)],
                         number(cap_vertex(face, polygon, t,
                                           c == 0   ? 0
                                           : c == 1 ? second
                                                    : 3 - second,
                                           at)));
              }
            });
      });
}

}  // namespace isobrick::gpu
