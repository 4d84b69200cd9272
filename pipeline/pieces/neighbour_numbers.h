#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <isobrick/mesh.h>

namespace isobrick::inline v0 {

/// What the numbers of a piece's vertices become in the mesh. In the piece they count from the
/// vertices of its neighbours on, tiles before the part, then through its own.
class NeighbourNumbers {
 public:
  void clear();
  /// The next neighbour; its first vertex has the number `first` in the mesh.
  void add(std::uint32_t vertices, std::uint32_t first);
  std::uint64_t vertices() const { return vertices_; }

  /// Renumbers triangles of the piece. Its first own vertex has the number `first` in the mesh, and
  /// `own` of them are known. False where a triangle names another.
  bool renumber(std::span<Triangle> triangles, std::uint64_t first, std::uint64_t own) const;

 private:
  struct Neighbour {
    std::uint64_t begin;  ///< its first vertex in the piece
    std::uint32_t first;  ///< the same in the mesh
  };
  std::uint32_t number_of(std::uint32_t vertex) const;

  std::vector<Neighbour> neighbours_;
  std::uint64_t vertices_ = 0;
};

}  // namespace isobrick
