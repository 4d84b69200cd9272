#pragma once

#include <array>
#include <optional>
#include <utility>

#include "surface/case_tables.h"
#include "surface/cell_math.h"
#include "surface/tile_kernels.h"
#include "surface/tile_state.h"

// Leaving degenerate triangles out. Where a sample equals the isovalue, the vertices
// of all active edges around it coincide. Here they become one vertex, a *coincident vertex*, and
// triangles with two corners in one vertex are left out. See docs/design/surface.md.

namespace isobrick::inline v0 {

/// The sample of type T at which vertices coincide: it equals the isovalue in the
/// type in which samples are interpolated. Nothing when no finite T does.
template <class T>
constexpr std::optional<T> coincident_value(double isovalue) {
  using Limits = std::numeric_limits<T>;
  if (!(isovalue >= static_cast<double>(Limits::lowest()) &&
        isovalue <= static_cast<double>(Limits::max())))
    return std::nullopt;
  const auto value = static_cast<T>(isovalue);
  if (static_cast<Real<T>>(value) != static_cast<Real<T>>(isovalue)) return std::nullopt;
  return value;
}

/// Whether vertices can coincide at any sample of the type.
bool has_coincident(ScalarType type, double isovalue);

namespace coincident {

/// The two corners of each edge of a cell.
inline constexpr auto kEdgeCorners = [] {
  std::array<std::array<std::uint8_t, 2>, 12> corners{};
  for (int a = 0; a < 8; ++a)
    for (int axis_bit = 1; axis_bit < 8; axis_bit *= 2)
      if (!(a & axis_bit))
        corners[static_cast<std::size_t>(case_rule::edge_between(a, a | axis_bit))] = {
            static_cast<std::uint8_t>(a), static_cast<std::uint8_t>(a | axis_bit)};
  return corners;
}();

/// The vertex on an active edge of a cell whose coincident vertices are the bits `at`: the
/// corner that is a coincident vertex, or 8 + edge. Only one end of an active edge can be one.
/// What is no edge is an inner vertex, which never is one.
constexpr int vertex_on(int edge, std::uint32_t at) {
  if (edge >= 12) return 8 + edge;
  const auto [a, b] = kEdgeCorners[static_cast<std::size_t>(edge)];
  return at >> a & 1 ? a : at >> b & 1 ? b : 8 + edge;
}

/// Calls f(a, b, c) with the vertices of each of `n` triangles on these edges that is kept;
/// the number of those that are not.
template <class F>
constexpr std::uint32_t for_each_kept(const std::uint8_t* edges, int n, std::uint32_t at, F&& f) {
  std::uint32_t left_out = 0;
  for (; n > 0; --n, edges += 3) {
    const int a = vertex_on(edges[0], at), b = vertex_on(edges[1], at), c = vertex_on(edges[2], at);
    if (a != b && b != c && c != a)
      f(a, b, c);
    else
      ++left_out;
  }
  return left_out;
}

/// The same for the triangles of a case.
template <class F>
constexpr std::uint32_t for_each_kept(const CaseTables& tables, std::uint32_t index,
                                      std::uint32_t at, F&& f) {
  return for_each_kept(tables.edges[index].data(), tables.triangles[index], at, std::forward<F>(f));
}

/// The eight bits of a cell at (x, y, z) from rows of bits, in the order of its corners.
constexpr std::uint32_t corner_bits(const std::uint64_t* rows, int x, int y, int z) {
  const std::uint64_t* row = rows + row_index(y, z);
  return static_cast<std::uint32_t>((row[0] >> x & 3) | (row[1] >> x & 3) << 2 |
                                    (row[kTileSamples] >> x & 3) << 4 |
                                    (row[kTileSamples + 1] >> x & 3) << 6);
}

}  // namespace coincident

/// After count_tile and count_patched_cells: leaves triangles out, marks the coincident vertices
/// that the rest has corners on, and completes the counts of triangles.
void count_coincident(TileState& tile);

}  // namespace isobrick
