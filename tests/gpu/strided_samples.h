#pragma once

#include <vector>

#include "tests/surface/field.h"

namespace isobrick::testing {

/// How the samples of an array lie.
struct SampleLayout {
  const char* name;
  int order[3];           ///< axes, the nearest samples first
  Index gap;              ///< samples left out after each along the first of them
  Index behind;           ///< samples behind each row
  bool reversed[3] = {};  ///< along x, y, z
  Index before = 0;       ///< samples before the first, which is then less aligned
};

inline constexpr SampleLayout kSampleLayouts[] = {
    {"C order", {0, 1, 2}, 0, 0},
    {"C order, rows apart", {0, 1, 2}, 0, 16},
    {"C order, not aligned", {0, 1, 2}, 0, 3, {}, 1},
    {"every second sample", {0, 1, 2}, 1, 0},
    {"Fortran order", {2, 1, 0}, 0, 0},
    {"y nearest, then x", {1, 0, 2}, 0, 5},
    {"y nearest, then z", {1, 2, 0}, 0, 0},
    {"x backwards", {0, 1, 2}, 0, 0, {true, false, false}},
    {"Fortran order, all backwards", {2, 1, 0}, 0, 1, {true, true, true}},
};

/// The samples of a field in another layout.
template <class T>
struct StridedSamples {
  std::vector<T> memory;
  Int3 strides;           ///< bytes
  std::size_t first = 0;  ///< index of sample (0, 0, 0)

  StridedSamples(const Field<T>& field, const SampleLayout& layout) {
    Index step = 1 + layout.gap, size = layout.before;
    Int3 steps;
    for (const int axis : layout.order) {
      steps[axis] = step;
      size += (field.extent[axis] - 1) * step;
      step = step * field.extent[axis] + (axis == layout.order[0] ? layout.behind : 0);
    }
    first = static_cast<std::size_t>(layout.before);
    memory.resize(static_cast<std::size_t>(size) + 1);
    for (int axis = 0; axis < 3; ++axis)
      if (layout.reversed[axis]) {
        first += static_cast<std::size_t>(steps[axis] * (field.extent[axis] - 1));
        steps[axis] = -steps[axis];
      }
    strides = steps * static_cast<Index>(sizeof(T));
    for_each_point(field.box(), [&](Int3 p) {
      memory[static_cast<std::size_t>(static_cast<Index>(first) + p.x * steps.x + p.y * steps.y +
                                      p.z * steps.z)] = field.at(p);
    });
  }
};

}  // namespace isobrick::testing
