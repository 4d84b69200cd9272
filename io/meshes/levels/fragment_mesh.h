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
  std::vector<Triangle> triangles;
};

/// Joins triangles into a mesh. Reused, it allocates little.
class FragmentWelder {
 public:
  /// Empties the mesh. `triangles` is how many there may be.
  void begin(std::size_t triangles);
  void add(const std::array<FragmentPoint, 3>& corners);
  const FragmentMesh& mesh() const { return mesh_; }

 private:
  std::uint32_t number_of(const FragmentPoint& point);
  void grow();

  FragmentMesh mesh_;
  std::vector<std::uint32_t> slots_;  ///< by hash: a vertex's number plus 1; 0: none
};

}  // namespace isobrick
