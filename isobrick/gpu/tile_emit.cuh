#pragma once

#include "isobrick/gpu/tile_classify.cuh"
#include "isobrick/gpu/tile_count.cuh"

// Last step: vertices and triangles, written where they belong.

namespace isobrick::gpu {

/// Up to 32 times three words from a warp to consecutive memory: through
/// shared memory, so that every store of the warp is one piece.
template <class Word>
__device__ inline void store_triples(std::uint32_t* staging, const std::uint32_t (&triple)[3],
                                     std::uint32_t count, Word* to) {
  static_assert(sizeof(Word) == 4);
#pragma unroll
  for (int i = 0; i < 3; ++i) staging[3 * lane_id() + i] = triple[i];
  __syncwarp();
#pragma unroll
  for (int i = 0; i < 3; ++i) {
    const std::uint32_t at = 32 * i + lane_id();
    if (at < 3 * count) reinterpret_cast<std::uint32_t*>(to)[at] = staging[at];
  }
  __syncwarp();
}

/// The map of WorldMap::position where nothing lies off the diagonal: the
/// terms left out are zeros.
__device__ inline Vec3f position_of(const TileParams& p, Vec3f at) {
  if (!p.diagonal) return p.world.position(at);
  return {p.world.origin[0] + p.world.m[0] * at.x, p.world.origin[1] + p.world.m[4] * at.y,
          p.world.origin[2] + p.world.m[8] * at.z};
}

template <class T>
struct VertexMaker {
  using R = float;
  const TileShared& s;
  const TileParams& p;
  const Shape& shape;
  R iso;

  __device__ R sample(int x, int y, int z) const {
    return static_cast<R>(__ldg(page_at<T>(s, x, y, z) + offset_in_page(x, y, z)));
  }

  __device__ float crossing_of(R a, R b) const {
    if constexpr (std::is_floating_point_v<T>) return crossing(a, b, iso);
    return (iso - a) / (b - a);
  }

  /// Central difference, one-sided at the volume's border.
  __device__ float difference(int axis, int at, R before, R here, R after) const {
    const int global = shape.origin[axis] + at;
    const bool low = global == 0, high = global == p.extent[axis] - 1;
    const R d = (high ? here : after) - (low ? here : before);
    return d * (low || high ? R(1) : R(0.5));
  }

  __device__ Vec3f gradient(int x, int y, int z, R here) const {
    return {difference(0, x, sample(x - 1, y, z), here, sample(x + 1, y, z)),
            difference(1, y, sample(x, y - 1, z), here, sample(x, y + 1, z)),
            difference(2, z, sample(x, y, z - 1), here, sample(x, y, z + 1))};
  }

  template <bool Normals>
  __device__ void make(std::uint32_t edge, Vec3f& position, Vec3f& normal) const {
    const int x = edge & 63u, y = edge >> 6 & 63u, z = edge >> 12 & 63u;
    const int axis = static_cast<int>(edge >> 18);
    const int dx = axis == 0, dy = axis == 1, dz = axis == 2;
    const R a = sample(x, y, z), b = sample(x + dx, y + dy, z + dz);
    const float t = crossing_of(a, b);
    Vec3f at{static_cast<float>(shape.origin[0] + x), static_cast<float>(shape.origin[1] + y),
             static_cast<float>(shape.origin[2] + z)};
    if (dx) at.x += t;
    if (dy) at.y += t;
    if (dz) at.z += t;
    position = position_of(p, at);
    if constexpr (Normals) {
      const Vec3f ga = gradient(x, y, z, a), gb = gradient(x + dx, y + dy, z + dz, b);
      const Vec3f g{ga.x + t * (gb.x - ga.x), ga.y + t * (gb.y - ga.y), ga.z + t * (gb.z - ga.z)};
      const float sign = b > a ? 1.0f : -1.0f;
      normal = p.world.unit_normal(g, {dx ? sign : 0.0f, dy ? sign : 0.0f, dz ? sign : 0.0f});
    }
  }
};

/// Writes the listed vertices, the first of which has number `first` in the tile.
template <class T, bool Normals>
__device__ inline void emit_vertices(TileShared& s, const TileParams& p, const Shape& shape,
                                     std::uint32_t first, std::uint32_t listed) {
  const VertexMaker<T> maker{s, p, shape, static_cast<float>(p.isovalue)};
  std::uint32_t* staging = s.staging[threadIdx.x >> 5];
  for (std::uint32_t begin = threadIdx.x & ~31u; begin < listed; begin += kThreads) {
    const std::uint32_t count = ::min(listed - begin, 32u);
    const std::uint32_t i = begin + ::min(lane_id(), count - 1);
    Vec3f position, normal;
    maker.template make<Normals>(s.edges[i], position, normal);
    const std::uint64_t to = 3 * (s.vertex_base + first + begin);
    const std::uint32_t words[3] = {__float_as_uint(position.x), __float_as_uint(position.y),
                                    __float_as_uint(position.z)};
    store_triples(staging, words, count, p.positions + to);
    if constexpr (Normals) {
      const std::uint32_t n[3] = {__float_as_uint(normal.x), __float_as_uint(normal.y),
                                  __float_as_uint(normal.z)};
      store_triples(staging, n, count, p.normals + to);
    }
  }
}

/// The vertex number on an edge of the cell at `x`, `row`. The mask has the bits of
/// the crossing edges before the cell's upper ones.
__device__ inline std::uint32_t vertex_number(const TileShared& s, const EdgePlace& place,
                                              std::uint32_t row, std::uint32_t mask) {
  const char* base = reinterpret_cast<const char*>(&s);
  const auto word = [base](std::uint32_t at) {
    return *reinterpret_cast<const std::uint32_t*>(base + at);
  };
  const std::uint32_t crossing =
      word(place.first_word + 8 * row) ^ word(place.second_word + 8 * row);
  return word(place.number + 4 * row) + __popc(crossing & mask >> place.shift);
}

/// Fills the tables of places and triangles; once a block.
__device__ inline void fill_tables(TileShared& s, const std::uint16_t* triangles) {
  for (unsigned i = threadIdx.x; i < 256 * 5; i += kThreads) s.triangles[i] = triangles[i];
  if (threadIdx.x >= 24) return;
  const unsigned e = threadIdx.x % 12, at_0 = threadIdx.x / 12;
  const unsigned axis = e / 4, first = e & 1u, second = e >> 1 & 1u;
  const auto at = static_cast<std::uint32_t>(offsetof(TileShared, rows));
  const auto next = at + 4u;
  EdgePlace place;
  if (axis == 0) {
    const unsigned row = first + 33 * second;
    place = {at + 8 * row, next + 8 * row,
             static_cast<std::uint32_t>(offsetof(TileShared, x_base)) + 4 * row, 0};
  } else {
    const unsigned row = axis == 1 ? 33 * second : second;
    const unsigned step = axis == 1 ? 1 : 33;
    const bool zero = at_0 && first == 0;
    const auto number =
        static_cast<std::uint32_t>(axis == 1 ? zero ? offsetof(TileShared, y_at_0)
                                                    : offsetof(TileShared, y_base)
                                   : zero ? offsetof(TileShared, z_at_0)
                                          : offsetof(TileShared, z_base));
    place = {next + 8 * row, next + 8 * (row + step), number + 4 * row, 1 - first};
  }
  s.places[at_0][e] = place;
}

/// Writes the triangles of the listed cells; `base` is the number of the first
/// of this warp's part in the mesh.
__device__ inline void emit_triangles(TileShared& s, const TileParams& p, std::uint32_t listed,
                                      std::uint64_t base) {
  const WarpPart part = part_of_warp(listed);
  std::uint32_t* staging = s.staging[threadIdx.x >> 5];
  auto* entries = reinterpret_cast<std::uint8_t*>(staging);
  for (std::uint32_t begin = part.begin; begin < part.end; begin += 32) {
    const std::uint32_t i = begin + lane_id();
    const std::uint32_t cell = i < part.end ? s.cells[i] : 0;
    const std::uint32_t own = i < part.end ? triangles_of(s, cell >> 16) : 0;
    const std::uint32_t sum = warp_inclusive_sum(own);
    const std::uint32_t all = __shfl_sync(kAll, sum, 31);
    // Lane by lane the triangles of up to 32 cells: cell | triangle << 5.
    std::uint32_t packed[5];
    const std::uint32_t before = sum - own;
#pragma unroll
    for (std::uint32_t t = 0; t < 5; ++t)
      if (t < own) entries[before + t] = static_cast<std::uint8_t>(lane_id() | t << 5);
    __syncwarp();
#pragma unroll
    for (std::uint32_t j = 0; j < 5; ++j)
      packed[j] = 32 * j < all ? entries[::min(32 * j + lane_id(), all - 1)] : 0;
    __syncwarp();
#pragma unroll
    for (std::uint32_t j = 0; j < 5; ++j) {
      if (32 * j >= all) break;
      const std::uint32_t source = __shfl_sync(kAll, cell, packed[j] & 31u);
      const std::uint32_t x = source & 31u, row = row_of_cell(source);
      const std::uint32_t mask = (1u << x) - 1u;
      const std::uint32_t edges = s.triangles[5 * (source >> 16) + (packed[j] >> 5)];
      const EdgePlace* places = s.places[x == 0];
      std::uint32_t corners[3];
#pragma unroll
      for (int c = 0; c < 3; ++c)
        corners[c] = vertex_number(s, places[edges >> 4 * c & 15u], row, mask);
      const std::uint32_t count = ::min(all - 32 * j, 32u);
      store_triples(staging, corners, count, p.triangles + 3 * (base + 32 * j));
    }
    base += all;
  }
}

}  // namespace isobrick::gpu
