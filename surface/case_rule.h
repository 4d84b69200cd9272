#pragma once

#include <array>
#include <cstdint>

// The 256 cases of marching cubes, derived from a rule at compile time, for
// both backends. Nothing here is copied from a published table.
//
// Numbering. Corner c of a cell is (c & 1, c >> 1 & 1, c >> 2); bit c of a case
// index is set when that corner is inside (sample >= isovalue). Edges: 0–3 along
// x at (y, z), 4–7 along y at (x, z), 8–11 along z at (x, y), the first named
// coordinate in the low bit.
//
// Rule. On every face, a segment cuts each connected group of outside corners
// off, where corners that touch only across a diagonal are not connected: the
// inside of an ambiguous face stays in one piece. (The other choice is as sound;
// this one gives the triangle counts of the literature.) The rule looks at the
// face alone, so two cells that share a face cut it alike, and no
// crack can open (the 15 cases under complement of Lorensen & Cline do not have
// this property). The segments of the six faces close into loops; a loop is
// triangulated without a diagonal between two edges of one face, because such a
// diagonal would lie in the face, where the neighbour may put one as well.

namespace isobrick::inline v0 {

inline constexpr int kMaxCaseTriangles = 5;

struct CaseTables {
  /// Triangles of a case.
  std::array<std::uint8_t, 256> triangles{};
  /// Three edges a triangle, counter-clockwise seen from outside; rows of 16 so
  /// that one vector load fetches a case. What follows the last triangle is 15.
  std::array<std::array<std::uint8_t, 16>, 256> edges{};

  friend constexpr bool operator==(const CaseTables&, const CaseTables&) = default;
};

namespace case_rule {

/// The edge between two corners that differ in one axis.
constexpr int edge_between(int a, int b) {
  const int low = a < b ? a : b;
  const int x = low & 1, y = low >> 1 & 1, z = low >> 2;
  const int axis_bit = a ^ b;
  return axis_bit == 1 ? y + 2 * z : axis_bit == 2 ? 4 + x + 2 * z : 8 + x + 2 * y;
}

/// The faces' corners, counter-clockwise seen from outside the cell.
inline constexpr int kFaces[6][4] = {{0, 4, 6, 2}, {1, 3, 7, 5},   // x = 0, x = 1
                                     {0, 1, 5, 4}, {2, 6, 7, 3},   // y = 0, y = 1
                                     {0, 2, 3, 1}, {4, 5, 7, 6}};  // z = 0, z = 1

/// Bit f is set when the edge lies on face f.
constexpr std::array<std::uint8_t, 12> faces_of_edges() {
  std::array<std::uint8_t, 12> faces{};
  for (int f = 0; f < 6; ++f)
    for (int i = 0; i < 4; ++i) {
      auto& bits =
          faces[static_cast<std::size_t>(edge_between(kFaces[f][i], kFaces[f][(i + 1) % 4]))];
      bits = static_cast<std::uint8_t>(bits | 1 << f);
    }
  return faces;
}

/// All faces of a cell, as bits.
inline constexpr int kAllFaces = 63;

/// The faces of a case whose inside corners touch across a diagonal only, as bits.
constexpr int ambiguous_faces(int index) {
  const auto inside = [index](int corner) { return (index >> corner & 1) != 0; };
  int faces = 0;
  for (int f = 0; f < 6; ++f)
    if (const auto& c = kFaces[f]; inside(c[0]) == inside(c[2]) && inside(c[1]) == inside(c[3]) &&
                                   inside(c[0]) != inside(c[1]))
      faces |= 1 << f;
  return faces;
}

/// For each active edge of a case, the edge that follows it around its loop; −1 elsewhere. The
/// inside of the ambiguous faces among `joined` stays in one piece, that of the others does not.
constexpr std::array<int, 12> successors(int index, int joined = kAllFaces) {
  const auto inside = [index](int corner) { return (index >> corner & 1) != 0; };
  const int separate = ambiguous_faces(index) & ~joined;
  std::array<int, 12> next{};
  next.fill(-1);
  for (int f = 0; f < 6; ++f)
    for (int i = 0; i < 4; ++i) {
      const auto& face = kFaces[f];
      const int before = face[(i + 3) % 4], first = face[i];
      if (separate >> f & 1) {
        if (inside(first))
          next[static_cast<std::size_t>(edge_between(before, first))] =
              edge_between(first, face[(i + 1) % 4]);
        continue;
      }
      if (!inside(before) || inside(first)) continue;
      int last = i;  // the group of outside corners is face[i … last]
      while (!inside(face[(last + 1) % 4])) ++last;
      next[static_cast<std::size_t>(edge_between(face[last % 4], face[(last + 1) % 4]))] =
          edge_between(before, first);
    }
  return next;
}

struct Loop {
  std::array<int, 12> edge{};
  int size = 0;
};

/// Takes the loop that begins at an edge out of the successors; empty where there is none.
constexpr Loop take_loop(std::array<int, 12>& next, int start) {
  Loop loop;
  for (int e = start; next[static_cast<std::size_t>(e)] >= 0;) {
    loop.edge[static_cast<std::size_t>(loop.size++)] = e;
    const int following = next[static_cast<std::size_t>(e)];
    next[static_cast<std::size_t>(e)] = -1;
    e = following;
  }
  return loop;
}

/// Room for the triangles of one loop.
using Corners = std::array<std::uint8_t, 30>;

/// Triangulates loop[first … last], whose side first–last is given, appending
/// to `out`. False when every way needs a diagonal inside a face.
constexpr bool triangulate(const Loop& loop, int first, int last, Corners& out, int& used) {
  constexpr auto faces = faces_of_edges();
  if (last - first < 2) return true;
  const auto allowed = [&](int i, int j) {
    const bool side = j - i == 1 || j - i == loop.size - 1;
    const auto a = static_cast<std::size_t>(loop.edge[static_cast<std::size_t>(i)]);
    const auto b = static_cast<std::size_t>(loop.edge[static_cast<std::size_t>(j)]);
    return side || (faces[a] & faces[b]) == 0;
  };
  for (int apex = first + 1; apex < last; ++apex) {
    if (!allowed(first, apex) || !allowed(apex, last)) continue;
    const int mark = used;
    for (const int corner : {first, apex, last})
      out[static_cast<std::size_t>(used++)] =
          static_cast<std::uint8_t>(loop.edge[static_cast<std::size_t>(corner)]);
    if (triangulate(loop, first, apex, out, used) && triangulate(loop, apex, last, out, used))
      return true;
    used = mark;
  }
  return false;
}

}  // namespace case_rule

/// The same triangles with the other orientation, for volumes whose axes are
/// left-handed in world space.
constexpr CaseTables mirrored(CaseTables tables) {
  for (std::size_t index = 0; index < 256; ++index)
    for (std::size_t t = 0; t < tables.triangles[index]; ++t) {
      auto& edges = tables.edges[index];
      const std::uint8_t second = edges[3 * t + 1];
      edges[3 * t + 1] = edges[3 * t + 2];
      edges[3 * t + 2] = second;
    }
  return tables;
}

/// Applies the rule to all cases. Fails to compile (or throws) if a loop had no
/// triangulation or a case more than five triangles.
constexpr CaseTables make_case_tables() {
  CaseTables tables;
  for (int index = 0; index < 256; ++index) {
    auto next = case_rule::successors(index);
    case_rule::Corners corners{};
    int used = 0;
    for (int start = 0; start < 12; ++start) {
      const case_rule::Loop loop = case_rule::take_loop(next, start);
      if (loop.size > 0 && !case_rule::triangulate(loop, 0, loop.size - 1, corners, used))
        throw "a loop has no triangulation off the faces";
    }
    if (used > 3 * kMaxCaseTriangles) throw "too many triangles";
    std::array<std::uint8_t, 16> edges{};
    for (std::size_t i = 0; i < 16; ++i) edges[i] = static_cast<int>(i) < used ? corners[i] : 15;
    tables.triangles[static_cast<std::size_t>(index)] = static_cast<std::uint8_t>(used / 3);
    tables.edges[static_cast<std::size_t>(index)] = edges;
  }
  return tables;
}

}  // namespace isobrick
