#pragma once

#include <cstdint>

#include "core/morton.h"

namespace isobrick::inline v0 {

/// The tiles from one place in the Morton order to another: a part of a mesh.
struct TileRange {
  std::uint64_t begin = 0;                ///< morton_encode() of the first tile
  std::uint64_t end = ~std::uint64_t{0};  ///< that of the first tile behind it
  /// Whether a vertex may belong to any of the 26 tiles around one that uses it; else only to those
  /// below: that is so of vertices on edges.
  bool looks_around = false;
  Int3 grid{Int3{1, 1, 1} * (Index{1} << 21)};  ///< tiles of the volume along x, y and z

  friend bool operator==(const TileRange&, const TileRange&) = default;

  bool empty() const { return begin >= end; }
  bool contains(Int3 tile) const { return holds(morton_encode(tile), 1); }
  /// Whether the mesh of the range needs anything of a cube of `edge` tiles, a power of two: of its
  /// own, or of tiles before it that may own its vertices. `cube` counts such cubes.
  bool needs(Int3 cube, Index edge = 1) const {
    const auto size = static_cast<std::uint64_t>(edge * edge * edge);
    if (morton_encode(cube) * size >= end) return false;
    const Index low = looks_around ? -1 : 0;
    for (Index z = low; z <= 1; ++z)
      for (Index y = low; y <= 1; ++y)
        for (Index x = low; x <= 1; ++x) {
          const Int3 other = cube + Int3{x, y, z};
          if (!Box3{{0, 0, 0}, grid}.contains(other * edge)) continue;
          if (holds(morton_encode(other) * size, size)) return true;
        }
    return false;
  }

 private:
  bool holds(std::uint64_t first, std::uint64_t count) const {
    return first < end && first + count > begin && !empty();
  }
};

}  // namespace isobrick
