#pragma once

#include <bit>
#include <cstdint>
#include <span>
#include <vector>

#include <isobrick/range.h>
#include "core/host_device.h"
#include "index/index_format.h"

namespace isobrick::inline v0 {

/// The min-max octree over items in a grid, as a pyramid of grids: level 0 has
/// the items, each further one a node for up to 2×2×2 of the level below (fewer
/// at the upper borders), the last a single node. Places and ids are implied.
template <class T>
struct OctreeView {
  static constexpr int kMaxLevels = 33;

  /// The nodes of a level.
  struct Level {
    std::uint64_t first = 0;       ///< place of its first range
    std::uint32_t extent[3] = {};  ///< ⌈extent of the grid / 2^level⌉
  };
  int levels = 0;
  Level pyramid[kMaxLevels + 1];  ///< and one that marks the end of the last
  const ValueRange<T>* ranges;

  ISOBRICK_HD OctreeView(const IndexHeader& header, SectionCursor& cursor) {
    std::uint64_t nodes = header.items, first = 0;
    for (; header.items && (levels == 0 || nodes != 1); ++levels, first += nodes) {
      nodes = 1;
      for (int axis = 0; axis < 3; ++axis) {
        const std::uint64_t up = (std::uint64_t{1} << levels) - 1;
        pyramid[levels].extent[axis] =
            static_cast<std::uint32_t>((header.grid[axis] + up) >> levels);
        nodes *= pyramid[levels].extent[axis];
      }
      pyramid[levels].first = first;
    }
    pyramid[levels].first = first;
    ranges = cursor.take<ValueRange<T>>(first);
  }

  static std::vector<std::byte> build(IndexHeader header, std::span<const ValueRange<T>> ranges);
  void check(const IndexHeader& header) const;
};

namespace index_detail {

/// The place of the lowest set bit of a byte that is not 0.
ISOBRICK_HD inline std::uint32_t lowest_bit(std::uint32_t byte) {
#ifdef __CUDA_ARCH__
  return static_cast<std::uint32_t>(__ffs(static_cast<int>(byte)) - 1);
#else
  return static_cast<std::uint32_t>(std::countr_zero(byte));
#endif
}

template <class T>
ISOBRICK_HD inline bool stabs(const ValueRange<T>& range, T value) {
  return (range.lo < value) & (value <= range.hi);
}

/// Bit x + 2·y + 4·z: of the nodes (2·px + x, 2·py + y, 2·pz + z) of a level, the
/// children of node (px, py, pz) above, the one that exists and is stabbed.
template <class T>
ISOBRICK_HD inline std::uint32_t stabbed_children(const OctreeView<T>& index, int level,
                                                  std::uint32_t px, std::uint32_t py,
                                                  std::uint32_t pz, T value) {
  const auto& at = index.pyramid[level];
  const std::uint32_t ex = at.extent[0], ey = at.extent[1];
  const std::uint64_t plane = std::uint64_t{ex} * ey;
  const ValueRange<T>* row =
      index.ranges + at.first + 2 * pz * plane + 2 * py * std::uint64_t{ex} + 2 * px;
  const std::uint32_t x1 = ex - 2 * px > 1, y1 = ey - 2 * py > 1, z1 = at.extent[2] - 2 * pz > 1;
  std::uint32_t bits = 0;
  // A neighbour that does not exist is the node itself again, and its bit is cut off.
  for (std::uint32_t octant = 0; octant < 8; ++octant) {
    const std::uint32_t x = octant & x1, y = octant >> 1 & y1, z = octant >> 2 & z1;
    bits |= static_cast<std::uint32_t>(stabs(row[z * plane + y * ex + x], value)) << octant;
  }
  return bits & (x1 ? 0xff : 0x55) & (y1 ? 0xff : 0x33) & (z1 ? 0xff : 0x0f);
}

/// Reports the items that `bits` names among the children of node (px, py, pz) of level 1.
template <class T, class Sink>
ISOBRICK_HD inline void report_items(const OctreeView<T>& index, std::uint32_t px, std::uint32_t py,
                                     std::uint32_t pz, std::uint32_t bits, Sink& sink) {
  // Ids are of 32 bits, so that nothing here wraps for an item that exists.
  const std::uint32_t ex = index.pyramid[0].extent[0], plane = ex * index.pyramid[0].extent[1];
  const std::uint32_t first = 2 * pz * plane + 2 * py * ex + 2 * px;
  for (; bits; bits &= bits - 1) {
    const std::uint32_t octant = lowest_bit(bits);
    sink.id(first + (octant >> 2) * plane + (octant >> 1 & 1) * ex + (octant & 1));
  }
}

}  // namespace index_detail

/// Reports the stabbed items in Z-order (Morton order) of the grid. The stack is
/// a byte for each level: the children that are still to be visited.
template <class T, class Sink>
ISOBRICK_HD void traverse(const OctreeView<T>& index, T value, Sink& sink) {
  if (index.levels == 0) return;
  const int top = index.levels - 1;
  sink.node();
  if (!index_detail::stabs(index.ranges[index.pyramid[top].first], value)) return;
  if (top == 0) return sink.id(0);
  std::uint8_t pending[OctreeView<T>::kMaxLevels] = {};
  std::uint32_t x = 0, y = 0, z = 0;  // a stabbed node of `level`
  for (int level = top;;) {
    const std::uint32_t bits = index_detail::stabbed_children(index, level - 1, x, y, z, value);
    if (level == 1) {
      sink.tested(8);
      index_detail::report_items(index, x, y, z, bits, sink);
    } else {
      for (int child = 0; child < 8; ++child) sink.node();
      x *= 2, y *= 2, z *= 2;
      pending[--level] = static_cast<std::uint8_t>(bits);
    }
    // Up until something is left to visit, then to the next of it.
    while (level < top && !pending[level]) x /= 2, y /= 2, z /= 2, ++level;
    if (level == top) return;
    const std::uint32_t left = pending[level], octant = index_detail::lowest_bit(left);
    pending[level] = static_cast<std::uint8_t>(left & (left - 1));
    x = (x & ~1u) | (octant & 1), y = (y & ~1u) | (octant >> 1 & 1), z = (z & ~1u) | octant >> 2;
  }
}

}  // namespace isobrick
