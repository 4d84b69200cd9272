#pragma once

#include <cstdint>

#include <isobrick/vec.h>

namespace isobrick::inline v0 {

/// Z-order code of a point with coordinates in [0, 2²¹): x in the lowest bit.
/// Monotone in every coordinate, so a point comes after all its lower neighbours.
constexpr std::uint64_t morton_encode(Int3 p) {
  constexpr auto spread = [](std::uint64_t v) {
    v &= 0x1fffff;
    v = (v | v << 32) & 0x001f00000000ffffULL;
    v = (v | v << 16) & 0x001f0000ff0000ffULL;
    v = (v | v << 8) & 0x100f00f00f00f00fULL;
    v = (v | v << 4) & 0x10c30c30c30c30c3ULL;
    v = (v | v << 2) & 0x1249249249249249ULL;
    return v;
  };
  return spread(static_cast<std::uint64_t>(p.x)) | spread(static_cast<std::uint64_t>(p.y)) << 1 |
         spread(static_cast<std::uint64_t>(p.z)) << 2;
}

constexpr Int3 morton_decode(std::uint64_t code) {
  constexpr auto compact = [](std::uint64_t v) {
    v &= 0x1249249249249249ULL;
    v = (v | v >> 2) & 0x10c30c30c30c30c3ULL;
    v = (v | v >> 4) & 0x100f00f00f00f00fULL;
    v = (v | v >> 8) & 0x001f0000ff0000ffULL;
    v = (v | v >> 16) & 0x001f00000000ffffULL;
    v = (v | v >> 32) & 0x1fffff;
    return static_cast<Index>(v);
  };
  return {compact(code), compact(code >> 1), compact(code >> 2)};
}

namespace morton_detail {

template <class F>
void visit(Int3 origin, Index edge, Int3 grid, F& f) {
  if (origin.x >= grid.x || origin.y >= grid.y || origin.z >= grid.z) return;
  if (edge == 1) {
    f(origin);
    return;
  }
  const Index half = edge / 2;
  for (int child = 0; child < 8; ++child)
    visit(origin + Int3{child & 1, child >> 1 & 1, child >> 2} * half, half, grid, f);
}

}  // namespace morton_detail

/// Calls f(p) for all points of [0, grid) in Z-order. Octants outside are
/// passed over whole, so skewed grids cost no more than their points.
template <class F>
void for_each_morton(Int3 grid, F&& f) {
  Index edge = 1;
  while (edge < grid.x || edge < grid.y || edge < grid.z) edge *= 2;
  morton_detail::visit(Int3{0, 0, 0}, edge, grid, f);
}

}  // namespace isobrick
