#pragma once

#include <map>
#include <ostream>

#include "tests/surface/cell_reference.h"
#include "tests/surface/field.h"
#include "tests/surface/patch_surface.h"

namespace isobrick::testing {

/// The Betti numbers b0 and b1 of a closed surface, and its Euler number.
struct Betti {
  int b0 = 0, b1 = 0, euler = 0;
  friend bool operator==(const Betti&, const Betti&) = default;
  friend std::ostream& operator<<(std::ostream& out, const Betti& b) {
    return out << "b0 " << b.b0 << " b1 " << b.b1 << " euler " << b.euler;
  }
};

/// Of an orientable closed surface: b2 = b0.
inline Betti betti(int components, int euler) {
  return {components, 2 * components - euler, euler};
}

inline Betti betti_of(const Mesh& mesh) {
  Sets sets(mesh.positions.size());
  for (const Triangle& t : mesh.triangles) {
    sets.join(t[0], t[1]);
    sets.join(t[0], t[2]);
  }
  int components = 0;
  for (std::uint32_t v = 0; v < mesh.positions.size(); ++v) components += sets.find(v) == v;
  return betti(components, static_cast<int>(mesh.positions.size()) -
                               static_cast<int>(mesh.triangles.size() / 2));
}

/// Whether every side is shared by two opposite triangles and the triangles around every vertex
/// form one ring.
inline bool is_closed_manifold(const Mesh& mesh) {
  if (closed_sides(mesh) < 0) return false;
  std::vector<std::map<std::uint32_t, std::uint32_t>> next(mesh.positions.size());
  for (const Triangle& t : mesh.triangles)
    for (std::size_t i = 0; i < 3; ++i) next[t[i]][t[(i + 1) % 3]] = t[(i + 2) % 3];
  return std::all_of(next.begin(), next.end(), [](const auto& around) {
    if (around.empty()) return false;
    std::size_t steps = 0;
    std::uint32_t at = around.begin()->first;
    do {
      const auto found = around.find(at);
      if (found == around.end()) return false;
      at = found->second;
    } while (++steps < around.size() && at != around.begin()->first);
    return steps == around.size() && at == around.begin()->first;
  });
}

/// The Betti numbers of the interpolant's surface: cells whose corners allow several surfaces are
/// refined. A sample that equals the isovalue counts as inside by `raise` more than it.
template <class T>
Betti betti_of_interpolant(const Field<T>& field, double isovalue, double raise) {
  const auto edge = [&](Int3 cell, int e) {
    const int axis = e / 4, i = e & 1, j = e >> 1 & 1;
    const Int3 offset = axis == 0 ? Int3{0, i, j} : axis == 1 ? Int3{i, 0, j} : Int3{i, j, 0};
    return static_cast<std::uint32_t>(3 * linear_index(cell + offset, field.extent) + axis);
  };
  Sets sets(3 * field.samples.size());
  std::vector<bool> used(3 * field.samples.size());
  int euler = 0;
  const auto& tables = topology_tables();
  for_each_point({{0, 0, 0}, field.extent - Int3{1, 1, 1}}, [&](Int3 cell) {
    Corners d;
    for (int c = 0; c < 8; ++c)
      d[static_cast<std::size_t>(c)] =
          static_cast<double>(field.at(cell + Int3{c & 1, c >> 1 & 1, c >> 2})) - isovalue + raise;
    const int index = case_of(d);
    if (index == 0 || index == 255) return;
    const CaseConfigurations& of_case = tables.cases[index];
    const CellSurface surface = of_case.needs_values
                                    ? refined_surface(d)
                                    : surface_of(tables.patches[of_case.consistent_patch]);
    if (surface.closed_piece) throw std::logic_error("refinements dispute");
    for (const int piece : surface.euler) euler += piece;
    std::array<int, 12> first;
    first.fill(-1);
    for (int e = 0; e < 12; ++e) {
      const int piece = surface.piece[static_cast<std::size_t>(e)];
      if (piece < 0) continue;
      used[edge(cell, e)] = true;
      int& of_piece = first[static_cast<std::size_t>(piece)];
      if (of_piece < 0) of_piece = e;
      sets.join(edge(cell, of_piece), edge(cell, e));
    }
    // Of the faces at the low ends along x, y and z: an arc is shared by two cells.
    for (const std::size_t f : {0u, 2u, 4u}) {
      int crossings = 0;
      for (std::size_t i = 0; i < 4; ++i)
        crossings += (index >> case_rule::kFaces[f][i] & 1) !=
                     (index >> case_rule::kFaces[f][(i + 1) % 4] & 1);
      euler -= crossings / 2;
    }
  });
  int components = 0;
  for (std::uint32_t e = 0; e < used.size(); ++e)
    if (used[e]) {
      ++euler;  // a vertex is in four cells and four faces
      components += sets.find(e) == e;
    }
  return betti(components, euler);
}

/// The interpolant of a field on a grid that is n times as fine.
template <class T>
Field<double> refined_field(const Field<T>& field, int n) {
  const Int3 cells = field.extent - Int3{1, 1, 1};
  return Field<double>(cells * n + Int3{1, 1, 1}, [&](Int3 p) {
    double sum = 0;
    Int3 low;
    double t[3];
    for (int axis = 0; axis < 3; ++axis) {
      low[axis] = std::min(p[axis] / n, cells[axis] - 1);
      t[axis] = static_cast<double>(p[axis] - low[axis] * n) / n;
    }
    for (int c = 0; c < 8; ++c) {
      double weight = 1;
      for (int axis = 0; axis < 3; ++axis) weight *= c >> axis & 1 ? t[axis] : 1 - t[axis];
      if (weight > 0)
        sum += weight * static_cast<double>(field.at(low + Int3{c & 1, c >> 1 & 1, c >> 2}));
    }
    return sum;
  });
}

}  // namespace isobrick::testing
