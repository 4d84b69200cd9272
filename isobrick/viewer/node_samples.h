#pragma once

#include <vector>

#include "isobrick/viewer/node_grid.h"
#include "isobrick/viewer/resident_bricks.h"

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
  void read(int v, Box3 points, double isovalue, const Wanted& wanted, GridValues& out);

  /// Bricks of the stored level that read() looks at.
  Box3 bricks(int v, Box3 points) const;

 private:
  Box3 samples(int v, Box3 points) const;
  void gather(int stored, Box3 box, double isovalue, const Wanted& wanted);

  const NodeGrid& grid_;
  ResidentBricks& bricks_;
  std::vector<float> gathered_, along_x_, along_y_;
};

}  // namespace isobrick
