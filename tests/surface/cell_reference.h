#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <map>
#include <numeric>
#include <vector>

#include "surface/case_tables.h"

// The topology of the trilinear interpolant in one cell, found by refinement: independent of the
// decisions in surface/cell_topology.h.

namespace isobrick::testing {

using Corners = std::array<double, 8>;

inline int case_of(const Corners& d) {
  int index = 0;
  for (std::size_t c = 0; c < 8; ++c) index |= (d[c] >= 0) << c;
  return index;
}

/// Sets of numbers that are joined.
class Sets {
 public:
  explicit Sets(std::size_t n) : parent_(n) { std::iota(parent_.begin(), parent_.end(), 0u); }
  std::uint32_t find(std::uint32_t i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }
  void join(std::uint32_t a, std::uint32_t b) { parent_[find(a)] = find(b); }

 private:
  std::vector<std::uint32_t> parent_;
};

/// Which of a cell's active edges a piece of the surface connects, and the Euler number of each
/// piece: all there is to know of pieces without handles.
struct CellSurface {
  std::array<int, 12> piece{};  ///< of each edge, numbered in their order; −1: not active
  std::vector<int> euler;       ///< of each piece
  bool closed_piece = false;    ///< a piece that touches no edge, which no interpolant has

  friend bool operator==(const CellSurface&, const CellSurface&) = default;
};

/// Numbers pieces by their first edges. `root`: any name of the piece on each edge, −1: none.
inline CellSurface numbered(const std::array<int, 12>& root, const std::map<int, int>& euler) {
  CellSurface surface;
  std::map<int, int> number;
  for (std::size_t e = 0; e < 12; ++e) {
    surface.piece[e] = -1;
    if (root[e] < 0) continue;
    const auto [at, is_new] = number.try_emplace(root[e], static_cast<int>(number.size()));
    if (is_new) surface.euler.push_back(euler.at(root[e]));
    surface.piece[e] = at->second;
  }
  surface.closed_piece = number.size() != euler.size();
  return surface;
}

/// The interpolant as a polynomial: k[i] is the factor of the product of the axes in i.
inline Corners polynomial(Corners k) {
  for (std::size_t axis = 1; axis < 8; axis *= 2)
    for (std::size_t c = 0; c < 8; ++c)
      if (c & axis) k[c] -= k[c ^ axis];
  return k;
}

/// Coordinates of the saddle points of the cell and of its faces. Along the axes through a saddle
/// point the interpolant is constant, so planes there separate what a uniform grid might not.
inline std::array<std::vector<double>, 3> saddle_coordinates(const Corners& d) {
  std::array<std::vector<double>, 3> at;
  for (std::size_t axis = 0; axis < 3; ++axis)
    for (std::size_t side = 0; side < 2; ++side) {
      const std::size_t u = axis == 0 ? 1 : 0, v = axis == 2 ? 1 : 2;
      const std::size_t o = side << axis, bu = std::size_t{1} << u, bv = std::size_t{1} << v;
      const double a = d[o], b = d[o + bu], c = d[o + bv], e = d[o + bu + bv], k = a - b - c + e;
      at[u].push_back((a - c) / k);
      at[v].push_back((a - b) / k);
    }
  const Corners k = polynomial(d);
  if (k[7] != 0) {
    // Shifted by s, the linear factors are f and the mixed ones 0.
    const double s[3] = {-k[6] / k[7], -k[5] / k[7], -k[3] / k[7]};
    const double f[3] = {k[1] + k[3] * s[1] + k[5] * s[2] + k[7] * s[1] * s[2],
                         k[2] + k[3] * s[0] + k[6] * s[2] + k[7] * s[0] * s[2],
                         k[4] + k[5] * s[0] + k[6] * s[1] + k[7] * s[0] * s[1]};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double square = -f[(axis + 1) % 3] * f[(axis + 2) % 3] / (f[axis] * k[7]);
      for (const double sign : {-1.0, 1.0})
        at[axis].push_back(s[axis] + sign * std::sqrt(std::max(square, 0.0)));
    }
  } else {
    const double xy = k[3], xz = k[5], yz = k[6];
    at[0].push_back((k[1] * yz - k[2] * xz - k[4] * xy) / (2 * xy * xz));
    at[1].push_back((k[2] * xz - k[1] * yz - k[4] * xy) / (2 * xy * yz));
    at[2].push_back((k[4] * xy - k[1] * yz - k[2] * xz) / (2 * xz * yz));
  }
  return at;
}

/// Marching cubes of the interpolant on a grid of n³ subcells and the planes of the saddle points.
class RefinedCell {
 public:
  RefinedCell(const Corners& d, int n) : k_(polynomial(d)) {
    at_ = saddle_coordinates(d);
    for (auto& at : at_) {
      std::erase_if(at, [](double v) { return !(v > 1e-9 && v < 1 - 1e-9); });
      for (int i = 0; i <= n; ++i) at.push_back(static_cast<double>(i) / n);
      std::sort(at.begin(), at.end());
      at.erase(std::unique(at.begin(), at.end(), [](double a, double b) { return b - a < 1e-9; }),
               at.end());
    }
    sample(d);
  }

  CellSurface surface() {
    vertices_.clear();
    number_.resize(std::max(number_.size(), 3 * inside_.size()), kNone);
    add_triangles();
    Sets sets(vertices_.size());
    for (const auto& t : triangles_) {
      sets.join(t[0], t[1]);
      sets.join(t[0], t[2]);
    }
    // Euler number: vertices − sides + triangles, and a side on the border is of one triangle only.
    std::map<int, int> twice;
    const auto of = [&](std::uint32_t v) -> int& { return twice[static_cast<int>(sets.find(v))]; };
    for (std::uint32_t v = 0; v < vertices_.size(); ++v) of(v) += 2;
    for (const auto& t : triangles_) {
      of(t[0]) -= 1;
      for (std::size_t i = 0; i < 3; ++i)
        if (outer_faces(vertices_[t[i]]) & outer_faces(vertices_[t[(i + 1) % 3]])) of(t[0]) -= 1;
    }
    for (auto& [piece, euler] : twice) euler /= 2;
    std::array<int, 12> root;
    for (int e = 0; e < 12; ++e) {
      const std::uint32_t v = vertex_on_edge(e);
      root[static_cast<std::size_t>(e)] = v == kNone ? -1 : static_cast<int>(sets.find(v));
    }
    for (const std::size_t v : vertices_) number_[v] = kNone;
    return numbered(root, twice);
  }

 private:
  static constexpr std::uint32_t kNone = ~0u;
  std::size_t extent(std::size_t axis) const { return at_[axis].size(); }
  std::size_t index(std::size_t x, std::size_t y, std::size_t z) const {
    return x + extent(0) * (y + extent(1) * z);
  }

  void sample(const Corners& d) {
    inside_.resize(extent(0) * extent(1) * extent(2));
    std::uint8_t* out = inside_.data();
    for (const double z : at_[2])
      for (const double y : at_[1]) {
        const double c0 = (k_[0] + k_[4] * z) + y * (k_[2] + k_[6] * z);
        const double c1 = (k_[1] + k_[5] * z) + y * (k_[3] + k_[7] * z);
        for (const double x : at_[0]) *out++ = c0 + x * c1 >= 0;
      }
    // Rounding must not change the corners.
    for (std::size_t c = 0; c < 8; ++c)
      inside_[index(c & 1 ? extent(0) - 1 : 0, c & 2 ? extent(1) - 1 : 0,
                    c & 4 ? extent(2) - 1 : 0)] = d[c] >= 0;
  }

  std::uint32_t vertex(std::size_t point, std::size_t axis) {
    std::uint32_t& number = number_[3 * point + axis];
    if (number == kNone) {
      number = static_cast<std::uint32_t>(vertices_.size());
      vertices_.push_back(3 * point + axis);
    }
    return number;
  }

  /// Whether the surface passes the cells of a row.
  bool crosses(const std::uint8_t* row, const std::size_t (&step)[3]) const {
    const auto differs = [&](const std::uint8_t* other) {
      return std::memchr(other, 1 - *row, extent(0)) != nullptr;
    };
    return differs(row) || differs(row + step[1]) || differs(row + step[2]) ||
           differs(row + step[1] + step[2]);
  }

  void add_triangles() {
    triangles_.clear();
    const std::size_t step[3] = {1, extent(0), extent(0) * extent(1)};
    for (std::size_t z = 0; z + 1 < extent(2); ++z)
      for (std::size_t y = 0; y + 1 < extent(1); ++y) {
        const std::uint8_t* row = inside_.data() + index(0, y, z);
        const auto column = [&](std::size_t x) {
          return static_cast<unsigned>(row[x] | row[x + step[1]] << 2 | row[x + step[2]] << 4 |
                                       row[x + step[1] + step[2]] << 6);
        };
        if (!crosses(row, step)) continue;
        unsigned next = column(0);
        for (std::size_t x = 0; x + 1 < extent(0); ++x) {
          const unsigned here = next;
          next = column(x + 1);
          const std::size_t cell = here | next << 1;
          if (cell == 0 || cell == 255) continue;
          const std::size_t point = index(x, y, z);
          const auto& edges = kCaseTables.edges[cell];
          for (std::size_t t = 0; t < kCaseTables.triangles[cell]; ++t) {
            std::array<std::uint32_t, 3> corners;
            for (std::size_t i = 0; i < 3; ++i) {
              const std::size_t e = edges[3 * t + i], axis = e / 4, u = e & 1, v = e >> 1 & 1;
              corners[i] =
                  vertex(point + u * step[axis == 0 ? 1 : 0] + v * step[axis == 2 ? 1 : 2], axis);
            }
            triangles_.push_back(corners);
          }
        }
      }
  }

  /// The faces of the cell that a vertex lies on, as bits.
  unsigned outer_faces(std::size_t vertex) const {
    const std::size_t own = vertex % 3;
    std::size_t rest = vertex / 3;
    unsigned faces = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const std::size_t i = rest % extent(axis);
      rest /= extent(axis);
      if (axis == own) continue;
      if (i == 0) faces |= 1u << 2 * axis;
      if (i == extent(axis) - 1) faces |= 2u << 2 * axis;
    }
    return faces;
  }

  std::uint32_t vertex_on_edge(int e) const {
    const auto axis = static_cast<std::size_t>(e / 4);
    const std::size_t u = axis == 0 ? 1 : 0, v = axis == 2 ? 1 : 2;
    std::array<std::size_t, 3> p{};
    if (e & 1) p[u] = extent(u) - 1;
    if (e & 2) p[v] = extent(v) - 1;
    for (p[axis] = 0; p[axis] + 1 < extent(axis); ++p[axis])
      if (const std::uint32_t n = number_[3 * index(p[0], p[1], p[2]) + axis]; n != kNone) return n;
    return kNone;
  }

  Corners k_;
  std::array<std::vector<double>, 3> at_;
  std::vector<std::uint8_t> inside_;
  /// Of the vertex on each edge of a grid; kept, because clearing it would take most of the time.
  inline static thread_local std::vector<std::uint32_t> number_;
  std::vector<std::size_t> vertices_;  ///< 3 · point + axis
  std::vector<std::array<std::uint32_t, 3>> triangles_;
};

/// The surface of a cell: refined until two refinements agree.
inline CellSurface refined_surface(const Corners& d) {
  CellSurface last = RefinedCell(d, 12).surface();
  for (int n = 24; n <= 192; n *= 2) {
    CellSurface next = RefinedCell(d, n).surface();
    if (next == last) return next;
    last = std::move(next);
  }
  last.closed_piece = true;  // disputed
  return last;
}

}  // namespace isobrick::testing
