#pragma once

#include <cstdint>
#include <span>

#include "filters/triangle_group.h"

namespace isobrick::inline v0 {

/// How far the vertices of a group and the centres of its triangles are at most from the surface
/// that collapses leave of it, in world units. `final_vertices` and `left` are what
/// final_vertices() and collapsed() return.
double collapse_error(const TriangleGroup& group, std::span<const std::uint32_t> final_vertices,
                      std::span<const Triangle> left);

}  // namespace isobrick
