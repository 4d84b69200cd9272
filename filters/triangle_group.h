#pragma once

#include <cstdint>
#include <vector>

#include <isobrick/mesh.h>

namespace isobrick::inline v0 {

/// Triangles near each other, with the vertices that they name.
struct TriangleGroup {
  std::vector<std::uint32_t> vertices;  ///< their numbers in the mesh, ascending
  std::vector<Vec3f> positions;         ///< of those, where they are needed
  std::vector<Triangle> triangles;      ///< that name `vertices` by their places
};

/// Lists the vertices that the triangles name by their numbers in the mesh, and names them by their
/// places.
void number_vertices(TriangleGroup& group);

}  // namespace isobrick
