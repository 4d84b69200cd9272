#pragma once

#include <cstddef>

#include <isobrick/mesh.h>
#include "gpu/memory/arena.h"

namespace isobrick::inline v0::gpu {

/// The arrays of a mesh, on the device or in pinned memory; owned by others.
struct MeshArrays {
  Vec3f *positions = nullptr, *normals = nullptr;  ///< no normals: null
  Triangle* triangles = nullptr;

  /// Slices of an arena.
  static MeshArrays take(Arena& arena, std::size_t vertices, std::size_t triangles, bool normals) {
    MeshArrays mesh;
    mesh.positions = arena.take<Vec3f>(vertices);
    if (normals) mesh.normals = arena.take<Vec3f>(vertices);
    mesh.triangles = arena.take<Triangle>(triangles);
    return mesh;
  }
  /// What they take.
  static std::size_t bytes(std::size_t vertices, std::size_t triangles, bool normals) {
    Arena measure;
    take(measure, vertices, triangles, normals);
    return Arena::aligned(measure.used());
  }
};

}  // namespace isobrick::gpu
