#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <isobrick/surface_options.h>
#include "surface/grid_view.h"

namespace isobrick::inline v0 {

/// Marching cubes over one small grid, on the calling thread. The mesh is a function of the
/// view alone, also in its order: gpu::GridBatch makes the same bytes.
///
/// Vertices, with normals: by row of points (z, then y), then by the axis of their edge, then
/// by x; then two for each vertex on a face where the grid meets a coarser one, to either
/// side of the surface. Triangles: by cell, x fastest, then by case; then the seam strips, two
/// triangles for each side that lies on such a face. Cells with a corner that is no number
/// are left out; edges between two numbers have their vertices all the same. One for each
/// thread: keeps its work space.
class GridExtractor {
 public:
  /// Replaces what `out` held. How many of the triangles, the last ones, are seam strips.
  std::uint32_t extract(const GridView& grid, Mesh& out);

 private:
  /// Bit x of a row of points; the last of kGridPoints points has a word of its own.
  struct Bits {
    std::uint64_t low = 0, last = 0;
  };
  struct Row {
    Bits inside, number;  ///< number: the value is one
  };
  /// The numbers of vertices on the edges from the points of a plane.
  using Plane = std::array<std::uint32_t, 3 * kGridPoints * kGridPoints>;

  void find_inside(const GridView& grid);
  template <int axis>
  void add_vertices(const GridView& grid, int y, int z, Bits active_edges, Mesh& out);
  void add_row(const GridView& grid, int y, int z, Mesh& out);
  void add_cells(const GridView& grid, int y, int z, Mesh& out);
  std::uint32_t add_seam_strips(const GridView& grid, Mesh& out);

  std::vector<Row> rows_;
  std::array<Plane, 2> planes_;
  std::vector<std::uint8_t> faces_;     ///< of each vertex, where the grid meets coarser ones
  std::vector<std::uint32_t> seam_of_;  ///< of each vertex: its first one beside it
  bool meets_coarser_ = false;
};

}  // namespace isobrick
