#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <optional>
#include <random>
#include <set>
#include <vector>

#include "core/dense_bricks.h"
#include "index/active_tiles.h"
#include "surface/case_tables.h"
#include "surface/cpu_extractor.h"

namespace isobrick::testing {

/// A small volume held whole.
template <class T>
struct Field {
  Int3 extent;
  std::vector<T> samples;

  explicit Field(Int3 e) : extent(e), samples(static_cast<std::size_t>(volume(e))) {}
  Field(Int3 e, const std::function<double(Int3)>& f) : Field(e) {
    for_each_point(box(), [&](Int3 p) { at(p) = static_cast<T>(f(p)); });
  }
  Box3 box() const { return {{0, 0, 0}, extent}; }
  T& at(Int3 p) { return samples[static_cast<std::size_t>(linear_index(p, extent))]; }
  const T& at(Int3 p) const { return samples[static_cast<std::size_t>(linear_index(p, extent))]; }
};

/// Random samples in [lo, hi], whose outermost layer is `border`.
template <class T>
Field<T> padded_noise(Int3 extent, double lo, double hi, T border, unsigned seed) {
  std::mt19937 random(seed);
  return Field<T>(extent, [&](Int3 p) -> double {
    const double v = lo + (hi - lo) * (static_cast<double>(random()) / 4294967296.0);
    const bool edge = p.x == 0 || p.y == 0 || p.z == 0 || p.x == extent.x - 1 ||
                      p.y == extent.y - 1 || p.z == extent.z - 1;
    return edge ? static_cast<double>(border) : std::is_integral_v<T> ? std::floor(v) : v;
  });
}

/// Block ranges by definition.
template <class T>
std::vector<ValueRange<T>> block_ranges(const Field<T>& field) {
  const Int3 blocks = Lattice{field.extent, {64, 64, 64}, scalar_type_of<T>}.blocks();
  std::vector<ValueRange<T>> ranges;
  for_each_point({{0, 0, 0}, blocks}, [&](Int3 b) {
    ValueRange<T> range;
    const Int3 lo = b * kBlockEdge;
    const Box3 touched{lo, lo + Int3{kBlockEdge + 1, kBlockEdge + 1, kBlockEdge + 1}};
    for_each_point(intersect(touched, field.box()), [&](Int3 p) { range.include(field.at(p)); });
    ranges.push_back(range);
  });
  return ranges;
}

struct Mesh {
  std::vector<Vec3f> positions, normals;
  std::vector<Triangle> triangles;
  std::uint64_t degenerate = 0;  ///< triangles left out
  friend bool operator==(const Mesh&, const Mesh&) = default;
};

struct Request {
  double isovalue = 0;
  Inside inside = Inside::above;
  Int3 brick{64, 64, 64};
  bool normals = false;
  Indexing indexing = Indexing::welded;
  std::optional<Box3> roi;
  Transform transform;
  std::size_t batch = ~std::size_t{0};  ///< tiles a call
  std::size_t workspaces = 64;
  bool drop_degenerate = false;
  Topology topology = Topology::consistent;
  bool cap = false;
};

/// Our mesh of a field, through bricks, ranges and the CPU extractor.
template <class T>
Mesh extract(const Field<T>& field, const Request& request) {
  const Lattice lattice{field.extent, request.brick, scalar_type_of<T>};
  const DenseBricks bricks(lattice, field.samples.data());
  SurfaceOptions options;
  options.isovalue = request.isovalue;
  options.normals = request.normals;
  options.indexing = request.indexing;
  options.roi = request.roi.value_or(lattice.box());
  options.transform = request.transform;
  options.inside = request.inside;
  options.drop_degenerate = request.drop_degenerate;
  options.topology = request.topology;
  options.cap = request.cap;
  if constexpr (std::is_floating_point_v<T>)
    for (const T v : field.samples) options.may_have_nan |= std::isnan(v);
  std::vector<TileWork> tiles;
  const auto ranges = block_ranges(field);
  const Box3 blocks{{0, 0, 0}, lattice.blocks()};
  if (request.cap)
    append_capped_tiles<T>(blocks, ranges, request.isovalue,
                           {request.inside, options.roi, options.may_have_nan}, tiles);
  else
    append_active_tiles<T>(blocks, ranges, request.isovalue, tiles);
  CpuExtractor extractor(lattice, options, {.tiles = request.workspaces});
  for (std::size_t i = 0; i < tiles.size(); i += std::min(request.batch, tiles.size()))
    extractor.extract(std::span(tiles).subspan(i, std::min(request.batch, tiles.size() - i)),
                      bricks, nullptr);
  const isobrick::Mesh& out = extractor.mesh();
  return {{out.positions.begin(), out.positions.end()},
          {out.normals.begin(), out.normals.end()},
          {out.triangles.begin(), out.triangles.end()},
          extractor.report().degenerate_triangles};
}

/// Each triangle as the three lattice edges its vertices lie on, rotated so
/// that the smallest comes first: a mesh without any order.
using EdgeKey = std::array<Index, 4>;                       // lower sample, axis
using EdgeTriangles = std::vector<std::array<EdgeKey, 3>>;  // sorted

inline std::array<EdgeKey, 3> rotated(std::array<EdgeKey, 3> t) {
  while (t[1] < t[0] || t[2] < t[0]) t = {t[1], t[2], t[0]};
  return t;
}

/// Marching cubes in its plainest form, straight from the tables: no bits, no
/// tiles, no numbers.
template <class T>
EdgeTriangles reference_triangles(const Field<T>& field, double isovalue) {
  EdgeTriangles triangles;
  const Int3 cells = field.extent - Int3{1, 1, 1};
  for_each_point({{0, 0, 0}, cells}, [&](Int3 cell) {
    std::size_t index = 0;
    for (int c = 0; c < 8; ++c) {
      const double v = static_cast<double>(field.at(cell + Int3{c & 1, c >> 1 & 1, c >> 2}));
      if (std::isnan(v)) return;
      index |= static_cast<std::size_t>(v >= isovalue) << c;
    }
    const auto key = [&](int e) -> EdgeKey {
      const int axis = e / 4, i = e & 1, j = e >> 1 & 1;
      const Int3 offset = axis == 0 ? Int3{0, i, j} : axis == 1 ? Int3{i, 0, j} : Int3{i, j, 0};
      const Int3 p = cell + offset;
      return {p.x, p.y, p.z, axis};
    };
    const auto& edges = kCaseTables.edges[index];
    for (std::size_t t = 0; t < kCaseTables.triangles[index]; ++t)
      triangles.push_back(
          rotated({key(edges[3 * t]), key(edges[3 * t + 1]), key(edges[3 * t + 2])}));
  });
  std::sort(triangles.begin(), triangles.end());
  return triangles;
}

/// The lattice edge of every vertex of an index-space mesh whose vertices lie
/// strictly inside their edges.
inline EdgeKey edge_of(Vec3f p) {
  EdgeKey key{};
  key[3] = -1;
  for (int axis = 0; axis < 3; ++axis) {
    const float low = std::floor(p[axis]);
    key[static_cast<std::size_t>(axis)] = static_cast<Index>(low);
    if (p[axis] != low) key[3] = axis;
  }
  return key;
}

inline EdgeTriangles edge_triangles(const Mesh& mesh) {
  EdgeTriangles triangles;
  for (const Triangle& t : mesh.triangles)
    triangles.push_back(rotated({edge_of(mesh.positions[t[0]]), edge_of(mesh.positions[t[1]]),
                                 edge_of(mesh.positions[t[2]])}));
  std::sort(triangles.begin(), triangles.end());
  return triangles;
}

/// The corners of the triangles, without order and without numbers.
inline std::multiset<std::array<float, 9>> soup(const Mesh& mesh) {
  std::multiset<std::array<float, 9>> triangles;
  for (const Triangle& t : mesh.triangles) {
    std::array<float, 9> corners{};
    for (std::size_t i = 0; i < 9; ++i)
      corners[i] = mesh.positions[t[i / 3]][static_cast<int>(i % 3)];
    triangles.insert(corners);
  }
  return triangles;
}

/// Checks that every side belongs to two triangles with opposite directions.
/// Returns the number of sides, or −1.
inline std::ptrdiff_t closed_sides(const Mesh& mesh) {
  const auto key = [](std::uint64_t from, std::uint64_t to) { return from << 32 | to; };
  std::vector<std::uint64_t> forward, backward;
  for (const Triangle& t : mesh.triangles)
    for (std::size_t i = 0; i < 3; ++i) {
      forward.push_back(key(t[i], t[(i + 1) % 3]));
      backward.push_back(key(t[(i + 1) % 3], t[i]));
    }
  std::sort(forward.begin(), forward.end());
  std::sort(backward.begin(), backward.end());
  const bool twice = std::adjacent_find(forward.begin(), forward.end()) != forward.end();
  return twice || forward != backward ? -1 : static_cast<std::ptrdiff_t>(forward.size()) / 2;
}

}  // namespace isobrick::testing
