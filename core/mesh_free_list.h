#pragma once

#include <cstdint>
#include <optional>

#include "core/free_list.h"

namespace isobrick::inline v0 {

/// The part of a block of vertices and triangles that a mesh has.
struct MeshRange {
  std::uint32_t first_vertex = 0, vertices = 0;
  std::uint32_t first_triangle = 0, triangles = 0;

  friend bool operator==(const MeshRange&, const MeshRange&) = default;
};

/// Which parts of a block of vertices and triangles are free.
class MeshFreeList {
 public:
  MeshFreeList(std::uint32_t vertices, std::uint32_t triangles)
      : vertices_(vertices), triangles_(triangles) {}

  /// Whether take() would give something.
  bool has(std::uint32_t vertices, std::uint32_t triangles) const {
    return vertices_.has(vertices) && triangles_.has(triangles);
  }
  /// Room for both, or nothing.
  std::optional<MeshRange> take(std::uint32_t vertices, std::uint32_t triangles) {
    if (!has(vertices, triangles)) return std::nullopt;
    return MeshRange{*vertices_.take(vertices), vertices, *triangles_.take(triangles), triangles};
  }
  /// Allocates nothing, so that destructors may call it.
  void give_back(const MeshRange& range) noexcept {
    vertices_.give_back(range.first_vertex, range.vertices);
    triangles_.give_back(range.first_triangle, range.triangles);
  }
  /// Gives back what lies behind the first so many of a mesh; returns what the mesh keeps.
  MeshRange trim(const MeshRange& range, std::uint32_t vertices, std::uint32_t triangles) {
    vertices_.trim(range.first_vertex, range.vertices, vertices);
    triangles_.trim(range.first_triangle, range.triangles, triangles);
    return {range.first_vertex, vertices, range.first_triangle, triangles};
  }

 private:
  FreeList vertices_, triangles_;
};

}  // namespace isobrick
