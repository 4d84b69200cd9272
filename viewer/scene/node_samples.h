#pragma once

#include <array>
#include <cstddef>
#include <utility>
#include <vector>

#include "stream/resident_bricks.h"
#include "viewer/scene/needed_samples.h"
#include "viewer/scene/node_grid.h"

namespace isobrick::inline v0 {

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

/// Reads the values at grid points from resident bricks. Not thread-safe; it keeps its buffers, so
/// use one for each thread.
class NodeSamples {
 public:
  NodeSamples(const NodeGrid& grid, ResidentBricks& bricks) : grid_(grid), bricks_(bricks) {}

  /// Writes sample − isovalue at the grid points `points` (of level v, inside the volume) as float:
  /// the isosurface is where the values cross 0. The subtraction is in double, so that no sample
  /// changes sides. At level 0 it does not read bricks that `needed` (null: all) does not need.
  void read(int v, Box3 points, double isovalue, const CancellationToken& token, GridValues& out,
            const NeededSamples* needed = nullptr);

  /// Writes the samples at the points `points` of level 0, in the store's type. Samples that
  /// `needed` (null: all) does not need get the smallest or the largest value of the type.
  void read_stored(Box3 points, const CancellationToken& token, std::vector<std::byte>& out,
                   const NeededSamples* needed);

  /// The bricks of the stored level that read() reads.
  Box3 bricks(int v, Box3 points) const;

 private:
  /// The samples that are read along an axis, and the positions of grid points among them.
  struct Axis {
    std::vector<Index> samples;  ///< ascending
    struct Point {
      Index first;  ///< index in `samples` of the first of its two samples
      float weight;
    };
    std::vector<Point> points;

    Index count() const { return static_cast<Index>(samples.size()); }
    /// The range of indices of the samples in [lo, hi).
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
  std::vector<Int3> needed_;  ///< bricks to read
  std::vector<float> gathered_, along_x_, along_y_;
};

}  // namespace isobrick
