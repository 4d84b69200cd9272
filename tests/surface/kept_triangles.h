#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <tuple>
#include <utility>

#include "surface/cell_math.h"
#include "tests/surface/field.h"

// What remains of a mesh when degenerate triangles are left out, straight from
// the definition: vertices of edges with an end that equals the isovalue become
// one at that end, and triangles with two equal vertices go.

namespace isobrick::testing {

inline EdgeTriangles without_equal_vertices(EdgeTriangles triangles) {
  std::erase_if(triangles,
                [](const auto& t) { return t[0] == t[1] || t[1] == t[2] || t[2] == t[0]; });
  for (auto& t : triangles) t = rotated(t);
  std::sort(triangles.begin(), triangles.end());
  return triangles;
}

/// A vertex on a sample has axis −1; edge_of() finds that by a position.
template <class T>
EdgeTriangles kept_triangles(const Field<T>& field, double isovalue) {
  EdgeTriangles triangles = reference_triangles(field, isovalue);
  const auto iso = static_cast<Real<T>>(isovalue);
  const auto merged = [&](EdgeKey e) -> EdgeKey {
    const Int3 low{e[0], e[1], e[2]};
    Int3 high = low;
    ++high[static_cast<int>(e[3])];
    for (const Int3 p : {low, high})
      if (static_cast<Real<T>>(field.at(p)) == iso) return {p.x, p.y, p.z, -1};
    return e;
  };
  for (auto& t : triangles) t = {merged(t[0]), merged(t[1]), merged(t[2])};
  return without_equal_vertices(std::move(triangles));
}

/// Every directed side is there as often as its reverse.
inline bool sides_balance(const Mesh& mesh) {
  std::vector<std::uint64_t> forward, backward;
  for (const Triangle& t : mesh.triangles)
    for (std::size_t i = 0; i < 3; ++i) {
      const std::uint64_t a = t[i], b = t[(i + 1) % 3];
      forward.push_back(a << 32 | b);
      backward.push_back(b << 32 | a);
    }
  std::sort(forward.begin(), forward.end());
  std::sort(backward.begin(), backward.end());
  return forward == backward;
}

/// How many triangles share a side: every number that occurs.
inline std::set<std::size_t> triangles_at_sides(const Mesh& mesh) {
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::size_t> sides;
  for (const Triangle& t : mesh.triangles)
    for (std::size_t i = 0; i < 3; ++i) ++sides[std::minmax(t[i], t[(i + 1) % 3])];
  std::set<std::size_t> numbers;
  for (const auto& [side, number] : sides) numbers.insert(number);
  return numbers;
}

inline std::size_t unused_vertices(const Mesh& mesh) {
  std::vector<bool> used(mesh.positions.size());
  for (const Triangle& t : mesh.triangles)
    for (const std::uint32_t v : t) used[v] = true;
  return static_cast<std::size_t>(std::count(used.begin(), used.end(), false));
}

inline std::size_t repeated_positions(const Mesh& mesh) {
  std::vector<std::tuple<float, float, float>> places;
  for (const Vec3f& p : mesh.positions) places.emplace_back(p.x, p.y, p.z);
  std::sort(places.begin(), places.end());
  const auto end = std::unique(places.begin(), places.end());
  return static_cast<std::size_t>(places.end() - end);
}

/// Checks a welded mesh in index space without degenerate triangles against the
/// ordinary one and against the definition; returns it.
template <class T>
Mesh expect_kept_triangles(const Field<T>& field, Request request) {
  request.drop_degenerate = false;
  const Mesh all = extract(field, request);
  request.drop_degenerate = true;
  Mesh kept = extract(field, request);
  EXPECT_EQ(kept.triangles.size() + kept.degenerate, all.triangles.size());
  EXPECT_EQ(unused_vertices(kept), 0u);
  EXPECT_EQ(repeated_positions(kept), 0u);
  const EdgeTriangles triangles = edge_triangles(kept);
  EXPECT_TRUE(triangles == without_equal_vertices(edge_triangles(all)));
  const Box3 roi = request.roi.value_or(field.box());
  Field<T> part(roi.extent());
  for_each_point(part.box(), [&](Int3 p) { part.at(p) = field.at(p + roi.lo); });
  EdgeTriangles expected = kept_triangles(part, request.isovalue);
  for (auto& t : expected)
    for (EdgeKey& e : t)
      for (int axis = 0; axis < 3; ++axis) e[static_cast<std::size_t>(axis)] += roi.lo[axis];
  std::sort(expected.begin(), expected.end());
  EXPECT_TRUE(triangles == expected);
  return kept;
}

}  // namespace isobrick::testing
