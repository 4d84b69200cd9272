#pragma once

#include <tbb/parallel_for.h>

#include <cstdint>
#include <vector>

#include <isobrick/scalar.h>
#include <isobrick/vec.h>
#include "surface/case_tables.h"
#include "surface/cell_math.h"

namespace isobrick::bench {

/// Marching cubes as the paper's brute force does it: every cell is visited, its
/// eight corners are compared, its triangles come with vertices of their own.
/// The number of triangles; parallel over planes of cells in the caller's arena.
/// `soup` has a list for each plane and is reused.
template <class T>
std::uint64_t cell_by_cell(const T* samples, Int3 extent, double isovalue,
                           std::vector<std::vector<Vec3f>>& soup) {
  const Index row = extent.x, plane = extent.x * extent.y;
  Index corner[8];
  for (int c = 0; c < 8; ++c) corner[c] = (c & 1) + (c >> 1 & 1) * row + (c >> 2) * plane;
  using R = Real<T>;
  const R iso = static_cast<R>(isovalue);
  soup.resize(static_cast<std::size_t>(extent.z - 1));
  tbb::parallel_for(Index{0}, extent.z - 1, [&](Index z) {
    std::vector<Vec3f>& out = soup[static_cast<std::size_t>(z)];
    out.clear();
    for (Index y = 0; y + 1 < extent.y; ++y)
      for (Index x = 0; x + 1 < extent.x; ++x) {
        const T* p = samples + z * plane + y * row + x;
        std::size_t index = 0;
        for (int c = 0; c < 8; ++c)
          index |= static_cast<std::size_t>(static_cast<R>(p[corner[c]]) >= iso) << c;
        const std::uint8_t* edges = kCaseTables.edges[index].data();
        for (int i = 0; i < 3 * kCaseTables.triangles[index]; ++i) {
          const int edge = edges[i], axis = edge >> 2, a = edge & 1, b = edge >> 1 & 1;
          const int low = axis == 0 ? 2 * a + 4 * b : axis == 1 ? a + 4 * b : a + 2 * b;
          const R from = static_cast<R>(p[corner[low]]),
                  to = static_cast<R>(p[corner[low | 1 << axis]]);
          Vec3f v{static_cast<float>(x + (low & 1)), static_cast<float>(y + (low >> 1 & 1)),
                  static_cast<float>(z + (low >> 2))};
          v[axis] += static_cast<float>((iso - from) / (to - from));
          out.push_back(v);
        }
      }
  });
  std::uint64_t vertices = 0;
  for (const auto& list : soup) vertices += list.size();
  return vertices / 3;
}

}  // namespace isobrick::bench
