#pragma once

#include <cstdint>
#include <vector>

#include "io/meshes/levels/chunk_lattice.h"

namespace isobrick::inline v0 {

/// A corner of a triangle that is cut, with the normal of the mesh there.
struct LatticeCorner {
  LatticePoint at{};
  Vec3f normal{};
};

/// A triangle that is cut, or a piece of one.
using CutTriangle = std::array<LatticeCorner, 3>;

/// Cuts triangles of a level's lattice at the faces of its fragments and, above level 0, at the
/// planes through their middles. What a side of a triangle becomes depends on that side alone, so
/// cut neighbours still share their sides, whichever fragments they are in. Not for several threads
/// at once.
class LatticeCut {
 public:
  /// Without `has_halves` no fragment is cut through its middle.
  LatticeCut(const ChunkGrid& grid, int level, bool has_halves = true);

  /// Calls f(piece, cell) for the pieces of a triangle, whose cell is that of a fragment, or of a
  /// half along each axis. Normals at cuts are interpolated along the side, of any length. Pieces
  /// without three different corners are left out, which opens no surface.
  template <class F>
  void for_each_piece(const CutTriangle& triangle, F&& f) {
    for (const CutTriangle& piece : pieces_of(triangle)) f(piece, cell_of(piece));
  }

  /// Calls f(cell) for the fragments that a triangle may have pieces in.
  template <class F>
  void for_each_fragment(const LatticeTriangle& triangle, F&& f) const {
    GridCell lo, hi;
    for (std::size_t axis = 0; axis < 3; ++axis) range_of(triangle, axis, lo[axis], hi[axis]);
    GridCell at;
    for (at[2] = lo[2]; at[2] <= hi[2]; ++at[2])
      for (at[1] = lo[1]; at[1] <= hi[1]; ++at[1])
        for (at[0] = lo[0]; at[0] <= hi[0]; ++at[0]) f(at);
  }

  /// Cells along the edge of a fragment.
  std::uint32_t halves() const { return halves_; }

 private:
  const std::vector<CutTriangle>& pieces_of(const CutTriangle& triangle);
  /// Cuts all of `from_` at the planes across an axis.
  void cut_along(std::size_t axis);
  GridCell cell_of(const CutTriangle& piece) const;
  void range_of(const LatticeTriangle& triangle, std::size_t axis, std::uint32_t& lo,
                std::uint32_t& hi) const;
  /// The place of a plane between cells.
  std::int64_t plane(std::int64_t cell) const;
  /// The last plane at or before a place.
  std::int64_t cell_at(std::int64_t place) const;

  std::uint32_t halves_;
  std::array<std::int64_t, 3> last_;  ///< cell along each axis
  std::vector<CutTriangle> from_, to_;
};

}  // namespace isobrick
