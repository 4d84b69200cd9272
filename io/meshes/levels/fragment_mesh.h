#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <isobrick/mesh.h>

namespace isobrick::inline v0 {

/// A position in a fragment, in steps from its lower corner: 16 bits.
using FragmentPoint = std::array<std::uint16_t, 3>;

/// The mesh of a fragment. Equal positions are one vertex.
struct FragmentMesh {
  std::vector<FragmentPoint> points;
  std::vector<Vec3f> normals;  ///< empty, or one a point: of its first corner, of any length
  std::vector<Triangle> triangles;
};

/// Joins triangles into a mesh. Reused, it allocates little.
class FragmentWelder {
 public:
  /// Empties the mesh. `triangles` is how many there may be.
  void begin(std::size_t triangles, bool has_normals = false);
  /// Normals are those of the corners, for a mesh that has some.
  void add(const std::array<FragmentPoint, 3>& corners, const std::array<Vec3f, 3>& normals = {});
  const FragmentMesh& mesh() const { return mesh_; }

 private:
  std::uint32_t number_of(const FragmentPoint& point, const Vec3f& normal);
  void grow();

  FragmentMesh mesh_;
  bool has_normals_ = false;
  std::vector<std::uint32_t> slots_;  ///< by hash: a vertex's number plus 1; 0: none
};

}  // namespace isobrick
