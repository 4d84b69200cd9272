#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <type_traits>
#include <vector>

#include <isobrick/mesh.h>

// Filters are templates of the type that numbers vertices: UInt32, or UInt64 for a mesh of more
// vertices (MeshHeader::wide), which takes twice the bytes a triangle.

namespace isobrick::inline v0 {

/// Triangle or WideTriangle.
template <class Number>
using TriangleOf = std::array<Number, 3>;

template <class Number>
inline constexpr bool kIsWide = std::is_same_v<Number, std::uint64_t>;

/// Throws Error for more than kMaxNarrowVertices.
void check_narrow_count(std::uint64_t vertices);

/// Throws Error where a mesh has more vertices than numbers can name.
template <class Number>
void check_vertex_count(std::uint64_t vertices) {
  if constexpr (!kIsWide<Number>) check_narrow_count(vertices);
}

/// Throws Error where a filtered mesh has too many vertices for the sink that it goes to, which has
/// not begun. `wide`: MeshHeader::wide.
void check_takes(const MeshSink& to, bool wide, std::uint64_t vertices);

/// The triangles of a chunk, whichever numbers it has; `converted` may hold them.
template <class Number>
std::span<const TriangleOf<Number>> triangles_of(const MeshChunk& chunk,
                                                 std::vector<TriangleOf<Number>>& converted) {
  if constexpr (kIsWide<Number>) {
    if (chunk.triangles.empty()) return chunk.wide_triangles;
    converted.clear();
    for (const Triangle& t : chunk.triangles) converted.push_back({t[0], t[1], t[2]});
    return converted;
  } else {
    return chunk.triangles;
  }
}

/// Writes triangles behind `vertices` vertices to a sink that has begun, with the numbers that its
/// header named.
template <class Number>
void write_triangles(MeshSink& to, bool wide, std::uint64_t vertices,
                     std::span<const TriangleOf<Number>> triangles) {
  if constexpr (kIsWide<Number>) {
    if (wide) return to.write({.first_vertex = vertices, .wide_triangles = triangles});
    std::vector<Triangle> narrow;
    narrow.reserve(triangles.size());
    for (const WideTriangle& t : triangles)
      narrow.push_back({static_cast<std::uint32_t>(t[0]), static_cast<std::uint32_t>(t[1]),
                        static_cast<std::uint32_t>(t[2])});
    to.write({.first_vertex = vertices, .triangles = narrow});
  } else {
    to.write({.first_vertex = vertices, .triangles = triangles});
  }
}

}  // namespace isobrick
