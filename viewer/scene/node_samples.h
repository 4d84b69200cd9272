#pragma once

#include <array>
#include <cstddef>
#include <utility>
#include <vector>

#include "stream/resident_bricks.h"
#include "viewer/scene/needed_samples.h"
#include "viewer/scene/node_grid.h"

namespace isobrick {

/// Values at the grid points of a box, C order [z, y, x].
struct GridValues {
  Box3 points;
  std::vector<float> values;

  float& at(Int3 p) {
    return values[static_cast<std::size_t>(linear_index(p - points.lo, points.extent()))];
  }
  const float& at(Int3 p) const {
    return values[static_cast<std::size_t>(linear_index(p - points.lo, points.extent()))];
  }
};

/// Reads the values at grid points from resident bricks. One for each thread: keeps
/// its work space.
class NodeSamples {
 public:
  NodeSamples(const NodeGrid& grid, ResidentBricks& bricks) : grid_(grid), bricks_(bricks) {}

  /// Sample − isovalue at the grid points `points` (of level v, all inside the
  /// volume), in float: the isosurface is where these cross 0. The subtraction is
  /// exact enough in double that no sample changes sides.
  /// Of level 0, bricks that `needed` has no need of are not read, unless it is null.
  void read(int v, Box3 points, double isovalue, const CancellationToken& token, GridValues& out,
            const NeededSamples* needed = nullptr);

  /// The samples themselves at the points `points` of level 0, in the store's type; those that
  /// `needed` has no need of are the least or the largest there is, unless it is null.
  void read_stored(Box3 points, const CancellationToken& token, std::vector<std::byte>& out,
                   const NeededSamples* needed);

  /// Bricks of the stored level that read() looks at.
  Box3 bricks(int v, Box3 points) const;

 private:
  /// What is looked at along an axis, and where grid points lie among that.
  struct Axis {
    std::vector<Index> samples;  ///< ascending
    struct Point {
      Index first;  ///< of the two numbers in `samples` that it lies between
      float weight;
    };
    std::vector<Point> points;

    Index count() const { return static_cast<Index>(samples.size()); }
    /// Which of the samples lie from `lo` on and before `hi`.
    std::pair<Index, Index> range(Index lo, Index hi) const;
  };

  void find_axis(int v, int axis, Index lo, Index hi);
  Box3 box() const;
  void gather(int stored, double isovalue, const CancellationToken& token,
              const NeededSamples* needed);
  template <class Take, class Skip>
  void for_each_brick(int stored, Box3 box, const CancellationToken& token,
                      const NeededSamples* needed, Take&& take, Skip&& skip);
  template <class T>
  void copy_part(const std::byte* brick, Int3 corner, Int3 edge, double isovalue);
  template <class F>
  void for_each_row(Int3 corner, Int3 edge, F&& f);

  const NodeGrid& grid_;
  ResidentBricks& bricks_;
  std::array<Axis, 3> axes_;
  std::vector<Int3> needed_;  ///< bricks
  std::vector<float> gathered_, along_x_, along_y_;
};

}  // namespace isobrick
