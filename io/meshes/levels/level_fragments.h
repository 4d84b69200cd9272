#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <vector>

#include <isobrick/progress.h>
#include "filters/mesh_spool.h"
#include "filters/scratch_array.h"
#include "io/meshes/levels/chunk_lattice.h"
#include "io/meshes/levels/level_writer.h"

namespace isobrick::inline v0 {

/// A number of a cell's place whose order is the Z-curve: bit 0 of x, of y, of z, bit 1 of x and so
/// on.
std::uint64_t z_order_key(const GridCell& cell);
/// The cell of a key.
GridCell cell_of_key(std::uint64_t key);

/// How a level is encoded.
struct FragmentWork {
  ScratchPlace place;
  std::uint64_t memory = 0;  ///< of the triangles that are sorted, in bytes
  std::uint64_t triangles_at_once = 0;
  int threads = 0;               ///< 0: all cores
  Progress* progress = nullptr;  ///< never null; bytes of each triangle three times
};

/// Triangles of a fragment and what they have at their corners.
struct LoadedTriangles {
  std::vector<std::array<Vec3f, 3>> positions;
  std::vector<std::array<Vec3f, 3>> normals;  ///< empty, or as many
};

/// The triangles of a level's mesh, sorted by the fragments that they touch.
template <class Number>
class LevelFragments {
 public:
  /// `mesh` and what `work` names must outlive it.
  LevelFragments(MeshSpool<Number>& mesh, const ChunkGrid& grid, int level,
                 const FragmentWork& work);

  /// Triangles of the fragment with most of them.
  std::uint64_t largest() const;

  /// Has `writer` encode and write the mesh of each fragment, in the order of their keys, and lists
  /// them. The bytes depend on nothing but the mesh and the grid.
  std::vector<EncodedFragment> encode(LevelWriter& writer);
  /// Bytes of the scratch file.
  std::uint64_t file_bytes() const { return sorted_.file_bytes(); }

 private:
  /// The triangles of a fragment among the sorted ones.
  struct Run {
    std::uint64_t begin = 0, end = 0;
    std::uint64_t size() const { return end - begin; }
  };

  /// Reports triangles. Throws Cancelled when an end was requested.
  void advance(std::uint64_t triangles) const;
  /// Calls f(triangle, run) for each triangle and each fragment that it touches.
  template <class F>
  void for_each_touched(F&& f);
  void sort();
  LatticeTriangle on_lattice(const TriangleOf<Number>& triangle);
  LoadedTriangles load(const Run& run);

  MeshSpool<Number>& mesh_;
  ChunkGrid grid_;
  int level_;
  const FragmentWork& work_;
  std::map<std::uint64_t, Run> runs_;  ///< by the fragment's key
  ScratchArray<TriangleOf<Number>> sorted_;
};

}  // namespace isobrick
