#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "isobrick/core/host_device.h"
#include "isobrick/core/range.h"
#include "isobrick/index/index_format.h"

namespace isobrick {

/// The min-max octree over items in a grid, as a pyramid of grids: level 0 has
/// the items, each further one a node for up to 2×2×2 of the level below (fewer
/// at the upper borders), the last a single node. Places and ids are implied.
template <class T>
struct OctreeView {
  static constexpr int kMaxLevels = 33;

  int levels = 0;
  std::uint32_t grid[3];
  std::uint64_t first[kMaxLevels + 1] = {};  ///< where each level begins
  const ValueRange<T>* ranges;

  OctreeView(const IndexHeader& header, SectionCursor& cursor)
      : grid{header.grid[0], header.grid[1], header.grid[2]} {
    if (header.items)
      for (std::uint64_t n = 0; n != 1; ++levels) {
        n = std::uint64_t{extent(0, levels)} * extent(1, levels) * extent(2, levels);
        first[levels + 1] = first[levels] + n;
      }
    ranges = cursor.take<ValueRange<T>>(first[levels]);
  }

  /// Nodes of a level along an axis: ⌈grid / 2^level⌉.
  ISOBRICK_HD std::uint32_t extent(int axis, int level) const {
    return static_cast<std::uint32_t>((grid[axis] + (std::uint64_t{1} << level) - 1) >> level);
  }

  static std::vector<std::byte> build(IndexHeader header, std::span<const ValueRange<T>> ranges);
  void check(const IndexHeader& header) const;
};

namespace index_detail {

template <class T>
ISOBRICK_HD inline bool stabs(const ValueRange<T>& range, T value) {
  return range.lo < value && value <= range.hi;
}

/// A node's place in the pyramid.
struct OctreePlace {
  int level;
  std::uint32_t x, y, z;
};

/// Moves on to the next node in Z-order that is no descendant; false at the end.
template <class T>
ISOBRICK_HD inline bool advance(const OctreeView<T>& index, OctreePlace& at) {
  for (; at.level + 1 < index.levels; ++at.level) {
    const std::uint32_t ex = index.extent(0, at.level), ey = index.extent(1, at.level),
                        ez = index.extent(2, at.level);
    for (std::uint32_t octant = (at.x & 1) + 2 * (at.y & 1) + 4 * (at.z & 1) + 1; octant < 8;
         ++octant) {
      const std::uint32_t x = (at.x & ~1u) + (octant & 1), y = (at.y & ~1u) + (octant >> 1 & 1),
                          z = (at.z & ~1u) + (octant >> 2);
      if (x < ex && y < ey && z < ez) {
        at = {at.level, x, y, z};
        return true;
      }
    }
    at = {at.level, at.x / 2, at.y / 2, at.z / 2};
  }
  return false;
}

/// Reports the stabbed ones of the up to eight items below a node of level 1.
template <class T, class Sink>
ISOBRICK_HD inline void report_items(const OctreeView<T>& index, const OctreePlace& at, T value,
                                     Sink& sink) {
  const std::uint32_t x0 = 2 * at.x, y0 = 2 * at.y, z0 = 2 * at.z;
  const std::uint32_t nx = index.grid[0] - x0 > 1 ? 2 : 1, ny = index.grid[1] - y0 > 1 ? 2 : 1,
                      nz = index.grid[2] - z0 > 1 ? 2 : 1;
  sink.tested(nx * ny * nz);
  for (std::uint32_t z = z0; z < z0 + nz; ++z)
    for (std::uint32_t y = y0; y < y0 + ny; ++y) {
      // Ids are of 32 bits, so this cannot wrap.
      const std::uint32_t id = (z * index.grid[1] + y) * index.grid[0] + x0;
      if (stabs(index.ranges[id], value)) sink.id(id);
      if (nx == 2 && stabs(index.ranges[id + 1], value)) sink.id(id + 1);
    }
}

}  // namespace index_detail

/// Reports the stabbed items in Z-order (Morton order) of the grid. Needs no
/// stack: a node's place says which comes next.
template <class T, class Sink>
ISOBRICK_HD void traverse(const OctreeView<T>& index, T value, Sink& sink) {
  if (index.levels == 0) return;
  index_detail::OctreePlace at{index.levels - 1, 0, 0, 0};
  do {
    for (;;) {
      const std::uint64_t row = std::uint64_t{at.z} * index.extent(1, at.level) + at.y;
      const std::uint64_t i = index.first[at.level] + row * index.extent(0, at.level) + at.x;
      sink.node();
      if (!index_detail::stabs(index.ranges[i], value)) break;
      if (at.level == 0) sink.id(0);  // a grid of one item
      if (at.level == 1) index_detail::report_items(index, at, value, sink);
      if (at.level <= 1) break;
      at = {at.level - 1, 2 * at.x, 2 * at.y, 2 * at.z};
    }
  } while (index_detail::advance(index, at));
}

}  // namespace isobrick
