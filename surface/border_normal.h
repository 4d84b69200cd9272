#pragma once

#include <cmath>

#include <isobrick/vec.h>
#include "core/host_device.h"

// The normals of a cap's vertices on samples. Arithmetic that both backends share verbatim.

namespace isobrick::inline v0 {

/// The unit normals of border faces across each axis, towards larger indices, in world space.
struct AxisNormals {
  double axis[3][3];
};

/// The sum of the normals of the border faces around sample (x, y, z); where they cancel out, that
/// of one of them. `exists(x, y, z)` tells whether a cell exists.
template <class Exists>
ISOBRICK_HD Vec3f border_normal(const AxisNormals& normals, int x, int y, int z,
                                const Exists& exists) {
  int sum[3] = {0, 0, 0}, any[3] = {0, 0, 0};
  for (int c = 0; c < 8; ++c) {
    const int at[3] = {x - 1 + (c & 1), y - 1 + (c >> 1 & 1), z - 1 + (c >> 2)};
    if (!exists(at[0], at[1], at[2])) continue;
    for (int axis = 0; axis < 3; ++axis) {
      const int out = c >> axis & 1 ? -1 : 1;  // to the other cell along the axis at this sample
      int other[3] = {at[0], at[1], at[2]};
      other[axis] += out;
      if (exists(other[0], other[1], other[2])) continue;
      sum[axis] += out;
      if (!any[0] && !any[1] && !any[2]) any[axis] = out;
    }
  }
  const int(&n)[3] = sum[0] || sum[1] || sum[2] ? sum : any;
  double v[3] = {0, 0, 0}, length = 0;
  for (int row = 0; row < 3; ++row) {
    for (int axis = 0; axis < 3; ++axis) v[row] += n[axis] * normals.axis[axis][row];
    length += v[row] * v[row];
  }
  length = std::sqrt(length);
  return {static_cast<float>(v[0] / length), static_cast<float>(v[1] / length),
          static_cast<float>(v[2] / length)};
}

}  // namespace isobrick
