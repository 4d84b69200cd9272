#pragma once

#include <cstdint>

#include <isobrick/scalar.h>
#include "surface/cell_math.h"

namespace isobrick::inline v0 {

/// Most points of a grid along an axis.
inline constexpr int kGridPoints = 65;

/// The values of a coarser grid on a face, whose contours the finer grid's vertices
/// there are moved onto.
struct LodSeam {
  const float* values = nullptr;  ///< the face's first axis fastest; null: no coarser grid
  int n[2] = {0, 0};              ///< points along the face's two axes
};

/// What stands at a grid point: 0 is the surface. Exact enough in double that no sample changes
/// sides.
template <class T>
ISOBRICK_HD inline float point_value(T sample, double isovalue) {
  return static_cast<float>(static_cast<double>(sample) - isovalue);
}

/// The samples that a grid's values are made of, as a store has them.
struct StoredPoints {
  const void* samples = nullptr;  ///< in the order of GridView::around
  ScalarType type = ScalarType::u8;
  double isovalue = 0;
};

/// The points of a grid in a box of at most kGridPoints a side, whose surface at 0 is looked
/// for: what both backends make a mesh of. A view; the arrays lie with who reads it. Point
/// (x, y, z) stands at values[z · plane + y · row + x].
struct GridView {
  const float* values = nullptr;
  int n[3] = {0, 0, 0}, row = 0, plane = 0;
  bool may_have_nan = false;
  /// The same before values on the border were replaced, with a layer of points around where
  /// the volume has one; gradients are made of these. Point p is p + shift here, without gaps
  /// between rows.
  const float* around = nullptr;
  /// Or, where no value on the border is replaced, what both are made of: then they are null, and
  /// gpu::GridBatch makes them on the device.
  StoredPoints stored;
  int around_n[3] = {0, 0, 0}, shift[3] = {0, 0, 0};
  /// Of each point of `around` along an axis: its place, and 1 / the distance between the
  /// points before and after it (itself at the ends).
  const double* place[3] = {nullptr, nullptr, nullptr};
  const float* inverse[3] = {nullptr, nullptr, nullptr};
  /// Places to where vertices belong: columns are the axes.
  double to_world[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  double offset[3] = {0, 0, 0};
  WorldMap map;  ///< only for normals and mirroring
  /// Coarser grids: on faces 2 · axis + side, points between two of theirs along each axis
  /// (1 or 2), their places, and half the width of a seam strip.
  LodSeam faces[6];
  int ratio[3] = {1, 1, 1};
  const double* coarse_place[3] = {nullptr, nullptr, nullptr};
  int coarse_n[3] = {0, 0, 0};  ///< how many places
  float seam_strip = 0;

  ISOBRICK_HD const float* at(int x, int y, int z) const {
    return values + (z * plane + y * row + x);
  }
  ISOBRICK_HD bool meets_coarser() const {
    bool any = false;
    for (int f = 0; f < 6; ++f) any |= faces[f].values != nullptr;
    return any;
  }
};

}  // namespace isobrick
