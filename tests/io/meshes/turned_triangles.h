#pragma once

#include <algorithm>
#include <array>
#include <string>
#include <vector>

#include <isobrick/mesh.h>
#include "io/meshes/readers/mesh_file.h"

namespace isobrick::inline v0 {

/// Each triangle as its corners' positions and normals, turned so that the smallest corner is the
/// first: the codec may turn them.
inline std::vector<std::array<Vec3f, 6>> turned(const std::string& path) {
  std::vector<std::array<Vec3f, 6>> triangles;
  open_mesh_file(path)->read({}, [&](const MeshChunk& chunk, Vec3d) {
    for (const Triangle& triangle : chunk.triangles) {
      std::array<std::array<Vec3f, 2>, 3> corners;
      for (std::size_t i = 0; i < 3; ++i)
        corners[i] = {chunk.positions[triangle[i]],
                      chunk.normals.empty() ? Vec3f{} : chunk.normals[triangle[i]]};
      const auto key = [](const std::array<Vec3f, 2>& c) {
        return std::array{c[0].x, c[0].y, c[0].z, c[1].x, c[1].y, c[1].z};
      };
      std::rotate(corners.begin(),
                  std::min_element(corners.begin(), corners.end(),
                                   [&](const auto& a, const auto& b) { return key(a) < key(b); }),
                  corners.end());
      triangles.push_back({corners[0][0], corners[0][1], corners[1][0], corners[1][1],
                           corners[2][0], corners[2][1]});
    }
  });
  return triangles;
}

}  // namespace isobrick
