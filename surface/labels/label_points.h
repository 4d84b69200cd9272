#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include <isobrick/vec.h>

namespace isobrick::inline v0 {

/// The corner at the lower end of an edge of a cell, as case_rule.h numbers both.
constexpr int low_corner(int edge) {
  constexpr int bits[3][2] = {{2, 4}, {1, 4}, {1, 2}};
  const int* of_axis = bits[edge / 4];
  return (edge & 1) * of_axis[0] + (edge >> 1 & 1) * of_axis[1];
}

/// How points are smoothed.
struct LabelSmoothing {
  int iterations = 0;      ///< of Taubin's λ|μ, each a step that shrinks and one that swells
  double pass_band = 0.1;  ///< as MeshFilterOptions::pass_band
  /// Layers of cells around that a point depends on.
  int reach() const { return 2 * iterations; }
};

/// The points of the cells whose corners have different labels. In the beginning each is the mean
/// of the middles of the edges that join different labels. Smoothing moves a point towards the
/// points behind the faces that a boundary passes, and keeps it in its cell, so points of different
/// cells never pass each other (Gibson 1998). Where three labels meet along a line, a point moves
/// towards its neighbours on the line only. All labels share the points.
class LabelPoints {
 public:
  /// Cells are numbers in a window of edge³ cells.
  explicit LabelPoints(int edge)
      : edge_(edge), index_of_(static_cast<std::size_t>(edge * edge * edge)) {}

  void clear();
  /// Adds a cell, in ascending order: its edges of different ends, and its faces whose corners have
  /// three labels or more, as bits.
  void add(int cell, int edges, int junctions);
  void smooth(const LabelSmoothing& smoothing);

  std::span<const std::uint32_t> cells() const { return cells_; }
  /// The place of an added cell among cells().
  std::uint32_t index_of(int cell) const { return index_of_[static_cast<std::size_t>(cell)]; }
  /// From the cell's first corner, in samples.
  Vec3f in_cell(std::uint32_t index) const { return points_[index]; }

  /// Bytes that one takes at most for a window of this edge.
  static std::uint64_t max_bytes(int edge);

 private:
  struct Neighbours {
    std::array<std::uint32_t, 6> of_face;  ///< kNone where the point does not move towards it
  };
  static constexpr std::uint32_t kNone = ~std::uint32_t{0};

  void find_neighbours();
  void step(float factor);

  int edge_;
  std::vector<std::uint32_t> index_of_;
  std::vector<std::uint32_t> cells_;
  std::vector<std::uint16_t> edges_;
  std::vector<std::uint8_t> junctions_;
  std::vector<Neighbours> neighbours_;
  std::vector<Vec3f> points_, moved_;
};

}  // namespace isobrick
