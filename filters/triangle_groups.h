#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include <isobrick/mesh.h>
#include "filters/scratch_array.h"
#include "filters/triangle_group.h"

namespace isobrick::inline v0 {

/// Sorts the triangles of a mesh into groups of boxes in space. Boxes are halves of halves of the
/// mesh's bounds, so the groups depend on nothing but the mesh.
template <class Number>
class TriangleGroups {
 public:
  /// Cells of the grid whose boxes are groups, along an axis.
  static constexpr int kCells = 64;

  /// `split` in (0, 1): where a box is divided. Groups of another place share no borders.
  TriangleGroups(const ScratchPlace& place, std::uint64_t memory, double split)
      : sorted_(place, memory), split_(split) {}

  /// Divides a mesh into groups of about `max_triangles` at most. Empties `triangles`.
  void sort(ScratchArray<Vec3f>& positions, const MeshBounds& bounds,
            ScratchArray<TriangleOf<Number>>& triangles, std::uint64_t max_triangles,
            const std::function<void()>& check_cancelled);

  std::size_t count() const { return begin_.empty() ? 0 : begin_.size() - 1; }
  /// Triangles of a group.
  std::uint64_t size(std::size_t group) const { return begin_[group + 1] - begin_[group]; }
  /// The triangles of a group, with their vertices' numbers in the mesh.
  std::vector<TriangleOf<Number>> load(std::size_t group);

  std::uint64_t file_bytes() const { return sorted_.file_bytes(); }
  std::uint64_t memory() const { return sorted_.memory(); }
  void release() { sorted_.release(); }

 private:
  void divide(const std::vector<std::uint64_t>& counts, Box3 box, std::uint64_t max_triangles);

  ScratchArray<TriangleOf<Number>> sorted_;
  double split_;
  std::vector<std::uint64_t> begin_;  ///< of each group in `sorted_`, and the end
  std::vector<std::uint32_t> group_of_cell_;
};

}  // namespace isobrick
