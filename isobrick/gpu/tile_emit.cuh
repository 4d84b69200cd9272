#pragma once

#include "isobrick/gpu/tile_classify.cuh"
#include "isobrick/gpu/tile_count.cuh"

// Last step: vertices and triangles, written where they belong.

namespace isobrick::gpu {

/// Up to 32 times three words from a warp to consecutive memory: through
/// shared memory, so that every store of the warp is one piece.
__device__ inline void store_triples(std::uint32_t* staging, const std::uint32_t (&triple)[3],
                                     std::uint32_t count, void* to) {
#pragma unroll
  for (int i = 0; i < 3; ++i) staging[3 * lane_id() + i] = triple[i];
  __syncwarp();
  auto* out = static_cast<std::uint32_t*>(to) + lane_id();
  if (count == 32) {
#pragma unroll
    for (int i = 0; i < 3; ++i) out[32 * i] = staging[32 * i + lane_id()];
  } else {
#pragma unroll
    for (int i = 0; i < 3; ++i)
      if (32 * i + lane_id() < 3 * count) out[32 * i] = staging[32 * i + lane_id()];
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

/// The edge of the tile's own vertex `number`, which lies in `row`: its lower
/// end along x, and its axis.
struct EdgeOfVertex {
  std::uint32_t x, axis;
};

__device__ inline EdgeOfVertex find_edge(const TileShared& s, const Shape& shape, std::uint32_t row,
                                         std::uint32_t number) {
  const std::uint32_t y_base = s.y_base[row], z_base = s.z_base[row];
  if (shape.at_0) {
    // The vertices at sample 0 stand before the others along y and along z.
    const auto z = static_cast<int>(z_of_row(row));
    const RowEdges e =
        edges_of_row(s, shape, static_cast<int>(row), static_cast<int>(row) - 33 * z, z);
    if (e.z_at_0 && number + 1 == z_base) return {0, 2};
    if (e.y_at_0 && number + 1 == y_base) return {0, 1};
  }
  const bool after_y = number >= y_base, after_z = number >= z_base;
  const std::uint32_t other = s.rows[row + (after_z ? 33 : after_y ? 1 : 0)].next;
  const RowBits here = s.rows[row];
  const std::uint32_t word =
      ((after_y ? here.next : here.at) ^ other) & (after_y ? shape.sample_mask : shape.cell_mask);
  const std::uint32_t base = after_z ? z_base : after_y ? y_base : s.x_base[row];
  return {nth_bit(word, number - base) + after_y, std::uint32_t{after_y} + after_z};
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

  /// The samples at (x, y, z) and one step along the axis.
  __device__ void ends(int x, int y, int z, int axis, R& a, R& b) const {
    int page = 13 + (x >> 5) + 3 * (y >> 5) + 9 * (z >> 5);
    int offset = offset_in_page(x, y, z);
    a = static_cast<R>(__ldg(static_cast<const T*>(s.pages[page]) + offset));
    const int step = 1 << 5 * axis, last = 31 << 5 * axis;
    const bool over = (offset & last) == last;
    offset = over ? offset - last : offset + step;
    if (over) page += axis == 0 ? 1 : axis == 1 ? 3 : 9;
    b = static_cast<R>(__ldg(static_cast<const T*>(s.pages[page]) + offset));
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

  /// An edge and the samples at its ends.
  struct Edge {
    int x, y, z, axis;
    R a, b;
  };

  __device__ Edge load(std::uint32_t row, EdgeOfVertex place) const {
    Edge e;
    e.x = static_cast<int>(place.x);
    e.z = static_cast<int>(z_of_row(row));
    e.y = static_cast<int>(row) - 33 * e.z;
    e.axis = static_cast<int>(place.axis);
    ends(e.x, e.y, e.z, e.axis, e.a, e.b);
    return e;
  }

  template <bool Normals>
  __device__ void make(const Edge& e, Vec3f& position, Vec3f& normal) const {
    const int dx = e.axis == 0, dy = e.axis == 1, dz = e.axis == 2;
    const float t = crossing_of(e.a, e.b);
    Vec3f at{static_cast<float>(shape.origin[0] + e.x), static_cast<float>(shape.origin[1] + e.y),
             static_cast<float>(shape.origin[2] + e.z)};
    if (dx) at.x += t;
    if (dy) at.y += t;
    if (dz) at.z += t;
    position = position_of(p, at);
    if constexpr (Normals) {
      const Vec3f ga = gradient(e.x, e.y, e.z, e.a),
                  gb = gradient(e.x + dx, e.y + dy, e.z + dz, e.b);
      const Vec3f g{ga.x + t * (gb.x - ga.x), ga.y + t * (gb.y - ga.y), ga.z + t * (gb.z - ga.z)};
      const float sign = e.b > e.a ? 1.0f : -1.0f;
      normal = p.world.unit_normal(g, {dx ? sign : 0.0f, dy ? sign : 0.0f, dz ? sign : 0.0f});
    }
  }
};

/// Writes the marked vertices, the first of which has number `first` in the tile.
/// The samples of one group are on their way while the next is looked up.
template <int N, class T, bool Normals>
__device__ inline void emit_vertices(TileShared& s, WarpShared& own, const TileParams& p,
                                     const Shape& shape, std::uint32_t first,
                                     std::uint32_t listed) {
  using Maker = VertexMaker<T>;
  const Maker maker{s, p, shape, p.crossing};
  const auto load = [&](std::uint32_t begin) {
    const std::uint32_t i = begin + lane_id();
    const std::uint32_t row = row_of_lane(s.vertex_marks[i], s.vertex_rows[begin / 32]);
    // Threads without a vertex take the last one again.
    const std::uint32_t number = first + ::min(i, listed - 1);
    return maker.load(row, find_edge(s, shape, row, number));
  };
  const WarpPart part = part_of_warp<N>(listed);
  if (part.begin >= part.end) return;
  const std::uint64_t start = 3 * (s.vertex_base + first + part.begin);
  float* to = p.positions + start;
  float* normals_to = p.normals + start;
  typename Maker::Edge edge = load(part.begin);
  for (std::uint32_t begin = part.begin; begin < part.end;
       begin += 32, to += 96, normals_to += 96) {
    typename Maker::Edge next = edge;
    if (begin + 32 < part.end) next = load(begin + 32);
    const std::uint32_t count = ::min(listed - begin, 32u);
    Vec3f position, normal;
    maker.template make<Normals>(edge, position, normal);
    const std::uint32_t words[3] = {__float_as_uint(position.x), __float_as_uint(position.y),
                                    __float_as_uint(position.z)};
    store_triples(own.staging, words, count, to);
    if constexpr (Normals) {
      const std::uint32_t n[3] = {__float_as_uint(normal.x), __float_as_uint(normal.y),
                                  __float_as_uint(normal.z)};
      store_triples(own.staging, n, count, normals_to);
    }
    edge = next;
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
template <int N>
__device__ inline void fill_tables(TileShared& s, const std::uint16_t* triangles) {
  for (unsigned i = threadIdx.x; i < 256 * 5; i += N) s.triangles[i] = triangles[i];
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
    const auto number = static_cast<std::uint32_t>(axis == 1 ? zero ? offsetof(TileShared, y_at_0)
                                                                    : offsetof(TileShared, y_base)
                                                   : zero ? offsetof(TileShared, z_at_0)
                                                             : offsetof(TileShared, z_base));
    place = {next + 8 * row, next + 8 * (row + step), number + 4 * row, 1 - first};
  }
  s.places[at_0][e] = place;
}

/// Writes `count` of the pending triangles, from the ring's place `first` on.
__device__ inline void emit_pending(const TileShared& s, WarpShared& own, std::uint32_t first,
                                    std::uint32_t count, std::uint32_t* to) {
  const std::uint32_t place = first + (count == 32 ? lane_id() : ::min(lane_id(), count - 1));
  const std::uint32_t entry = own.pending[place % WarpShared::kRing];
  const std::uint32_t cell = s.cells[entry & 0xfffu];
  const std::uint32_t x = cell & 31u, row = cell >> 5 & 0x7ffu;
  const std::uint32_t mask = (1u << x) - 1u;
  const std::uint32_t edges = s.triangles[5 * (cell >> 16) + (entry >> 12)];
  const EdgePlace* places = s.places[x == 0];
  std::uint32_t corners[3];
#pragma unroll
  for (int c = 0; c < 3; ++c)
    corners[c] = vertex_number(s, places[edges >> 4 * c & 15u], row, mask);
  store_triples(own.staging, corners, count, to);
}

/// Writes the triangles of the listed cells; `base` is the number of the first
/// of this warp's part in the mesh. Triangles wait until there are 32 of them,
/// whatever cells they come from, so that no thread idles.
template <int N>
__device__ inline void emit_triangles(TileShared& s, WarpShared& own, const TileParams& p,
                                      std::uint32_t listed, std::uint64_t base) {
  const WarpPart part = part_of_warp<N>(listed);
  std::uint32_t* to = p.triangles + 3 * base;
  std::uint32_t written = 0, waiting = 0;
  for (std::uint32_t begin = part.begin; begin < part.end; begin += 32) {
    const std::uint32_t i = begin + lane_id();
    const std::uint32_t count = i < part.end ? triangles_of(s, s.cells[i] >> 16) : 0;
    // The sum before each lane from the bits of the counts: three votes.
    const unsigned ones = __ballot_sync(kAll, count & 1u), twos = __ballot_sync(kAll, count & 2u),
                   fours = __ballot_sync(kAll, count & 4u), below = lanes_below();
    const std::uint32_t place = written + waiting + __popc(ones & below) +
                                2 * __popc(twos & below) + 4 * __popc(fours & below);
#pragma unroll
    for (std::uint32_t t = 0; t < 5; ++t)
      if (t < count)
        own.pending[(place + t) % WarpShared::kRing] = static_cast<std::uint16_t>(i + (t << 12));
    waiting += __popc(ones) + 2 * __popc(twos) + 4 * __popc(fours);
    __syncwarp();
    for (; waiting >= 32; waiting -= 32, written += 32, to += 96)
      emit_pending(s, own, written, 32, to);
  }
  if (waiting > 0) emit_pending(s, own, written, waiting, to);
}

}  // namespace isobrick::gpu
