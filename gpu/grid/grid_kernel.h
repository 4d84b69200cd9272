#pragma once

#include <cuda_runtime_api.h>

#include <cstdint>

#include <isobrick/mesh.h>
#include "surface/case_rule.h"
#include "surface/grid_view.h"

namespace isobrick::inline v0::gpu {

inline constexpr int kGridRows = kGridPoints * kGridPoints;

/// A row of a grid's points: which are inside, which are numbers (the last of kGridPoints
/// points has a word of its own); which edges from its points cross, along x, y, z, and the
/// number of the first vertex on each of them; the number of the first triangle of the cells
/// above it.
struct GridRow {
  std::uint64_t inside[2], number[2];
  std::uint64_t active_edges[3][2];
  std::uint32_t first_vertex[3], first_triangle;
  std::uint32_t border_vertices, seam_sides;  ///< in rows before
};

/// How large a grid's mesh is, seam strips apart.
struct GridTotals {
  std::uint32_t vertices, triangles;
  std::uint32_t border_vertices, seam_sides;  ///< two vertices, two triangles each
};

/// A grid on the device, and the work space of its mesh there.
struct GridWork {
  GridView grid;
  const CaseTables* tables;
  GridRow* rows;            ///< kGridRows
  std::uint32_t* counts;    ///< 4 · kGridRows
  std::uint8_t* faces;      ///< of each vertex; only where coarser grids meet this one
  std::uint32_t* seam_of;   ///< of each vertex, likewise
  GridTotals* totals;       ///< on the device
  GridTotals* host_totals;  ///< the same, in pinned memory
  /// The mesh, and the room there is; a mesh that does not fit is not written.
  Vec3f *positions, *normals;
  Triangle* triangles;
  std::uint32_t vertex_room, triangle_room;
  bool meets_coarser;
};

/// Grids whose meshes are made together.
struct GridBatchWork {
  const GridWork* works = nullptr;  ///< on the device
  int count = 0;
  int max_rows = 0;                ///< rows of points in the largest of them
  bool any_meets_coarser = false;  ///< whether any of them does
  bool any_stored = false;         ///< whether any of them is of stored samples
};

/// Makes the values of grids that are of stored samples, first of all.
void launch_grid_values(const GridBatchWork& batch, cudaStream_t stream);
/// Finds the sizes of the meshes, into their `totals`.
void launch_grid_count(const GridBatchWork& batch, cudaStream_t stream);
/// Writes the meshes that were counted, where there is room for them.
void launch_grid_mesh(const GridBatchWork& batch, cudaStream_t stream);

}  // namespace isobrick::gpu
