#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <isobrick/mesh.h>
#include "filters/vertex_numbers.h"

namespace isobrick::inline v0 {

/// Triangles near each other, with the vertices that they name.
struct TriangleGroup {
  std::size_t vertices = 0;         ///< how many there are
  std::vector<Vec3f> positions;     ///< of those, where they are needed
  std::vector<Triangle> triangles;  ///< that name vertices by their places in the group
};

/// The same of a larger mesh.
template <class Number>
struct GroupOfMesh : TriangleGroup {
  std::vector<Number> numbers;  ///< of its vertices in the mesh, ascending
};

/// The group of triangles that name vertices by their numbers in the mesh. Without positions.
template <class Number>
GroupOfMesh<Number> group_of(const std::vector<TriangleOf<Number>>& triangles);

}  // namespace isobrick
