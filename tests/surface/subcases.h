#pragma once

#include <array>
#include <bit>
#include <string>
#include <vector>

#include "surface/topology_tables.h"
#include "tests/surface/cell_reference.h"

// Chernyaev's names of what a cell's surface can be, from the case and the decisions.

namespace isobrick::testing {

/// The number of a case, 0 … 14, for at most four corners inside.
inline int base_case(int index) {
  std::array<int, 8> neighbours{};
  int edges = 0, pairs = 0, count = 0;
  for (int a = 0; a < 8; ++a) {
    if (!(index >> a & 1)) continue;
    ++count;
    for (int bit = 1; bit < 8; bit *= 2)
      if (index >> (a ^ bit) & 1) {
        ++neighbours[static_cast<std::size_t>(a)];
        ++edges;
      }
    pairs += index >> (7 - a) & 1;
  }
  edges /= 2;
  const int most = *std::max_element(neighbours.begin(), neighbours.end());
  if (count < 2) return count;
  if (count == 2) return edges == 1 ? 2 : pairs > 0 ? 4 : 3;
  if (count == 3) return edges == 2 ? 5 : edges == 1 ? 6 : 7;
  if (edges == 4) return 8;
  if (edges == 0) return 13;
  if (edges == 2) return most == 1 ? 10 : 12;
  if (most == 3) return 9;
  // A chain of four along three axes, left- or right-handed.
  int end = 0;
  while (!(index >> end & 1) || neighbours[static_cast<std::size_t>(end)] != 1) ++end;
  std::array<int, 3> axes{};
  for (int i = 0, at = end, before = -1; i < 3; ++i)
    for (int axis = 0; axis < 3; ++axis)
      if (const int next = at ^ 1 << axis; next != before && index >> next & 1) {
        axes[static_cast<std::size_t>(i)] = axis;
        before = at;
        at = next;
        break;
      }
  const bool even = (axes[1] + 2) % 3 == axes[0];
  // Each step of the axes' order and each mirrored end turns the hand around.
  return even == (std::popcount(static_cast<unsigned>(end)) % 2 == 0) ? 11 : 14;
}

/// The name of a cell's surface, with ′ where it is the complement's: "6.1.2", "13.5.2′".
inline std::string subcase(const Corners& d, const CellPatch& patch) {
  const int index = case_of(d);
  const int inside = std::popcount(static_cast<unsigned>(index));
  bool complement = inside > 4;
  const int base = base_case(complement ? 255 - index : index);
  int faces = 0, joined = 0;
  for (const auto& f : case_rule::kFaces) {
    const std::array<double, 4> v{
        d[static_cast<std::size_t>(f[0])], d[static_cast<std::size_t>(f[1])],
        d[static_cast<std::size_t>(f[2])], d[static_cast<std::size_t>(f[3])]};
    if ((v[0] >= 0) != (v[2] >= 0) || (v[1] >= 0) != (v[3] >= 0) || (v[0] >= 0) == (v[1] >= 0))
      continue;
    ++faces;
    joined += cell_topology::joins_inside(v[0], v[1], v[2], v[3]) != complement;
  }
  const bool tunnel = patch.diagonal >= 0;
  const std::string last = tunnel ? ".2" : ".1";
  std::string name = std::to_string(base);
  switch (base) {
    case 3: name += joined ? ".2" : ".1"; break;
    case 4: name += ".1" + last; break;
    case 6: name += joined ? ".2" : ".1" + last; break;
    case 7: name += joined < 3 ? "." + std::to_string(joined + 1) : ".4" + last; break;
    case 10:
    case 12:
      name += joined == 1 ? ".2" : ".1" + last;
      complement = joined == 0;
      break;
    case 13: {
      complement = joined > 3;
      const int few = std::min(joined, 6 - joined);
      if (few < 3) {
        name += "." + std::to_string(few + 1);
        break;
      }
      // Two loops around opposite corners and one between them, or one loop: it has a centre.
      const bool one = patch.centre[0] != 0 && std::popcount(unsigned{patch.centre[0]}) == 12;
      name += one ? ".4" : ".5" + last;
      break;
    }
    default: break;
  }
  return complement ? name + "′" : name;
}

}  // namespace isobrick::testing
