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
  void add(std::uint32_t vertices, std::uint64_t first);
  std::uint64_t vertices() const { return vertices_; }

  /// Renumbers triangles of the piece. Its first own vertex has the number `first` in the mesh, and
  /// `own` of them are known. False where a triangle names another.
  bool renumber(std::span<Triangle> triangles, std::uint64_t first, std::uint64_t own) const;
  /// The same for a mesh of more vertices than 32 bits number; `wide` has as many triangles.
  bool renumber(std::span<const Triangle> triangles, std::uint64_t first, std::uint64_t own,
                std::span<WideTriangle> wide) const;

 private:
  struct Neighbour {
    std::uint64_t begin;  ///< its first vertex in the piece
    std::uint64_t first;  ///< the same in the mesh
  };
  std::uint64_t number_of(std::uint32_t vertex) const;
  template <class To>
  bool renumber_to(std::span<const Triangle> triangles, std::uint64_t first, std::uint64_t own,
                   To* to) const;

  std::vector<Neighbour> neighbours_;
  std::uint64_t vertices_ = 0;
};

}  // namespace isobrick
