#pragma once

#include "gpu/tile/tile_classify.cuh"
#include "gpu/tile/tile_lists.cuh"

// The vertices of a tile, written where they belong.

namespace isobrick::inline v0::gpu {

/// Writes what nobody reads soon: samples of tiles to come stay in the L2 cache instead.
__device__ inline void store_once(Vec3f& to, const Vec3f& v) {
  __stcs(&to.x, v.x);
  __stcs(&to.y, v.y);
  __stcs(&to.z, v.z);
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

/// `at_0`, a bool or known when compiled: the tile has vertices at sample 0.
template <class At0>
__device__ inline EdgeOfVertex find_edge(const TileShared& s, At0 at_0, std::uint32_t row,
                                         std::uint32_t number) {
  const std::uint32_t y_first = s.number[1][row], z_first = s.number[2][row];
  if (at_0) {
    // The vertices at sample 0 stand before the others along y and along z: between them
    // and what lies before there is one number more than edges.
    const std::uint32_t z = z_of_row(row), y = row - 33 * z;
    const bool own_y = y > 0 || s.shape.first[1], own_z = z > 0 || s.shape.first[2];
    const std::uint32_t xs = own_y && own_z ? __popc(s.edge_bits[0][row]) : 0;
    const std::uint32_t ys = own_z ? __popc(s.edge_bits[1][row]) : 0;
    if (number + 1 == z_first && number == y_first + ys) return {0, 2};
    if (number + 1 == y_first && number == s.number[0][row] + xs) return {0, 1};
  }
  const std::uint32_t axis = std::uint32_t{number >= y_first} + (number >= z_first);
  return {nth_bit(s.edge_bits[axis][row], number - s.number[axis][row]) + (axis > 0), axis};
}

template <class T>
struct VertexMaker {
  using R = Real<T>;
  const TileShared& s;
  const TileParams& p;
  R iso;

  __device__ R sample(int x, int y, int z) const {
    return static_cast<R>(__ldg(sample_at<T>(s, block_at(x, y, z), x + 32 * y + 1024 * z)));
  }

  __device__ float edge_parameter_of(R a, R b) const {
    if constexpr (std::is_floating_point_v<T>) return static_cast<float>(edge_parameter(a, b, iso));
    return static_cast<float>((iso - a) / (b - a));
  }

  /// Central difference, one-sided at the volume's border.
  __device__ float difference(int axis, int at, R before, R here, R after) const {
    const int global = s.shape.origin[axis] + at;
    const bool low = global == 0, high = global == p.extent[axis] - 1;
    const R d = (high ? here : after) - (low ? here : before);
    return static_cast<float>(d * (low || high ? R(1) : R(0.5)));
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

  __device__ Edge load(std::uint32_t row, EdgeOfVertex edge) const {
    Edge e;
    e.x = static_cast<int>(edge.x);
    e.z = static_cast<int>(z_of_row(row));
    e.y = static_cast<int>(row) - 33 * e.z;
    e.axis = static_cast<int>(edge.axis);
    const int block = block_at(e.x, e.y, e.z);
    const int place = row_start(static_cast<int>(row), e.z) + e.x;
    e.a = static_cast<R>(__ldg(sample_at<T>(s, block, place)));
    const int along = e.axis == 0 ? e.x : e.axis == 1 ? e.y : e.z;
    // 1, 3 or 9 tile blocks on, 1, 32 or 1024 samples.
    const int next = block + (along == 31 ? 0x931 >> 4 * e.axis & 15 : 0);
    e.b = static_cast<R>(__ldg(sample_at<T>(s, next, place + (1 << 5 * e.axis))));
    return e;
  }

  template <bool Normals>
  __device__ void make(const Edge& e, Vec3f& position, Vec3f& normal) const {
    const int dx = e.axis == 0, dy = e.axis == 1, dz = e.axis == 2;
    const float t = edge_parameter_of(e.a, e.b);
    Vec3f at{static_cast<float>(s.shape.origin[0] + e.x),
             static_cast<float>(s.shape.origin[1] + e.y),
             static_cast<float>(s.shape.origin[2] + e.z)};
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
template <int N, class T, bool Normals, class At0>
__device__ inline void write_listed_vertices_of(TileShared& s, const TileParams& p,
                                                std::uint32_t first, std::uint32_t listed,
                                                At0 at_0) {
  using Maker = VertexMaker<T>;
  const Maker maker{s, p, static_cast<typename Maker::R>(p.isovalue)};
  const auto& lists = lists_of<N>(s);
  Vec3f* const positions = kept(p.positions + s.vertex_base + first);
  Vec3f* const normals = Normals ? kept(p.normals + s.vertex_base + first) : nullptr;
  const std::uint32_t lanes = kept(lanes_below() << 1 | 1u);
  for_each_group(s.next_vertices, listed, [&](std::uint32_t group) {
    const std::uint32_t i = 32 * group + lane_id();
    const std::uint32_t row =
        place_of_lane(lists.vertex_marks[i], lists.vertex_groups[group], lanes).row;
    if (i >= listed) return;
    const typename Maker::Edge edge = maker.load(row, find_edge(s, at_0, row, first + i));
    Vec3f position, normal;
    maker.template make<Normals>(edge, position, normal);
    store_once(positions[i], position);
    if constexpr (Normals) store_once(normals[i], normal);
  });
}

/// The same for any tile.
template <int N, class T, bool Normals>
__device__ inline void write_listed_vertices(TileShared& s, const TileParams& p,
                                             std::uint32_t first, std::uint32_t listed) {
  const bool at_0 = s.shape.at_0 != 0;
  if (Normals)  // which leave no registers for what else would be kept
    write_listed_vertices_of<N, T, Normals>(s, p, first, listed, at_0);
  else if (at_0)
    write_listed_vertices_of<N, T, Normals>(s, p, first, listed, std::true_type());
  else
    write_listed_vertices_of<N, T, Normals>(s, p, first, listed, std::false_type());
}

}  // namespace isobrick::gpu
