#pragma once

#include <map>
#include <utility>

#include "surface/topology_tables.h"
#include "tests/surface/cell_reference.h"

namespace isobrick::testing {

/// What a patch's triangles connect.
inline CellSurface surface_of(const CellPatch& patch) {
  const std::uint8_t* corners = topology_tables().corners + patch.first;
  Sets sets(kFirstInner + kMaxPatchInner);
  std::array<bool, kFirstInner + kMaxPatchInner> used{};
  std::map<std::pair<int, int>, int> sides;  // without direction
  for (int t = 0; t < patch.triangles; ++t)
    for (int i = 0; i < 3; ++i) {
      const int a = corners[3 * t + i], b = corners[3 * t + (i + 1) % 3];
      used[static_cast<std::size_t>(a)] = true;
      sets.join(static_cast<std::uint32_t>(a), static_cast<std::uint32_t>(b));
      ++sides[std::minmax(a, b)];
    }
  const auto piece = [&](int v) {
    return static_cast<int>(sets.find(static_cast<std::uint32_t>(v)));
  };
  std::map<int, int> euler;
  std::array<int, 12> root;
  for (int v = 0; v < static_cast<int>(used.size()); ++v) {
    if (v < 12)
      root[static_cast<std::size_t>(v)] = used[static_cast<std::size_t>(v)] ? piece(v) : -1;
    if (used[static_cast<std::size_t>(v)]) ++euler[piece(v)];
  }
  for (const auto& [side, count] : sides) --euler[piece(side.first)];
  for (int t = 0; t < patch.triangles; ++t) ++euler[piece(corners[3 * t])];
  return numbered(root, euler);
}

}  // namespace isobrick::testing
