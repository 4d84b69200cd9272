#include "filters/triangle_groups.h"

#include <algorithm>
#include <cmath>

#include "core/vectors.h"

namespace isobrick::inline v0 {
namespace {

constexpr int kCells = TriangleGroups<std::uint32_t>::kCells;
constexpr Int3 kGrid{kCells, kCells, kCells};

/// The cell of a triangle's centre.
class CellOf {
 public:
  CellOf(ScratchArray<Vec3f>& positions, const MeshBounds& bounds)
      : positions_(positions), lo_(bounds.lo) {
    for (int axis = 0; axis < 3; ++axis) {
      const double extent = bounds.hi[axis] - bounds.lo[axis];
      scale_[axis] = extent > 0 ? kCells / extent : 0;
    }
  }

  template <class Number>
  std::size_t operator()(const TriangleOf<Number>& t) const {
    Vec3d sum;
    for (const Number v : t) sum = sum + to_double(positions_[v]);
    Int3 cell;
    for (int axis = 0; axis < 3; ++axis) {
      const double at = (sum[axis] / 3 - lo_[axis]) * scale_[axis];
      cell[axis] = at > 0 ? static_cast<Index>(std::min<double>(at, kCells - 1)) : 0;
    }
    return static_cast<std::size_t>(linear_index(cell, kGrid));
  }

 private:
  ScratchArray<Vec3f>& positions_;
  Vec3d lo_, scale_;
};

std::uint64_t count_in(const std::vector<std::uint64_t>& counts, Box3 box) {
  std::uint64_t sum = 0;
  for_each_point(box,
                 [&](Int3 c) { sum += counts[static_cast<std::size_t>(linear_index(c, kGrid))]; });
  return sum;
}

}  // namespace

template <class Number>
void TriangleGroups<Number>::divide(const std::vector<std::uint64_t>& counts, Box3 box,
                                    std::uint64_t max_triangles) {
  const std::uint64_t count = count_in(counts, box);
  if (count == 0) return;
  const Int3 extent = box.extent();
  int axis = 0;
  for (int i = 1; i < 3; ++i)
    if (extent[i] > extent[axis]) axis = i;
  if (count <= max_triangles || extent[axis] == 1) {
    const auto group = static_cast<std::uint32_t>(begin_.size() - 1);
    for_each_point(box, [&](Int3 c) {
      group_of_cell_[static_cast<std::size_t>(linear_index(c, kGrid))] = group;
    });
    begin_.push_back(begin_.back() + count);
    return;
  }
  const auto at =
      std::clamp<Index>(static_cast<Index>(std::lround(split_ * static_cast<double>(extent[axis]))),
                        1, extent[axis] - 1);
  Box3 low = box, high = box;
  low.hi[axis] = high.lo[axis] = box.lo[axis] + at;
  divide(counts, low, max_triangles);
  divide(counts, high, max_triangles);
}

template <class Number>
void TriangleGroups<Number>::sort(ScratchArray<Vec3f>& positions, const MeshBounds& bounds,
                                  ScratchArray<TriangleOf<Number>>& triangles,
                                  std::uint64_t max_triangles,
                                  const std::function<void()>& check_cancelled) {
  const CellOf cell_of(positions, bounds);
  std::vector<std::uint64_t> counts(static_cast<std::size_t>(volume(kGrid)));
  triangles.for_each_run([&](std::span<const TriangleOf<Number>> run, std::uint64_t) {
    check_cancelled();
    for (const auto& t : run) ++counts[cell_of(t)];
  });
  begin_.assign(1, 0);
  group_of_cell_.assign(counts.size(), 0);
  divide(counts, {{0, 0, 0}, kGrid}, max_triangles);
  sorted_.clear();
  sorted_.resize(triangles.size());
  std::vector<std::uint64_t> next(begin_.begin(), begin_.end() - 1);
  triangles.for_each_run([&](std::span<const TriangleOf<Number>> run, std::uint64_t) {
    check_cancelled();
    for (const auto& t : run) sorted_.edit(next[group_of_cell_[cell_of(t)]]++) = t;
  });
  triangles.clear();
}

template <class Number>
std::vector<TriangleOf<Number>> TriangleGroups<Number>::load(std::size_t group) {
  std::vector<TriangleOf<Number>> loaded;
  loaded.reserve(static_cast<std::size_t>(size(group)));
  sorted_.for_each_run(begin_[group], begin_[group + 1],
                       [&](std::span<const TriangleOf<Number>> run, std::uint64_t) {
                         loaded.insert(loaded.end(), run.begin(), run.end());
                       });
  return loaded;
}

template <class Number>
GroupOfMesh<Number> group_of(const std::vector<TriangleOf<Number>>& triangles) {
  GroupOfMesh<Number> group;
  std::vector<Number>& numbers = group.numbers;
  numbers.reserve(3 * triangles.size());
  for (const auto& t : triangles) numbers.insert(numbers.end(), t.begin(), t.end());
  std::ranges::sort(numbers);
  numbers.erase(std::unique(numbers.begin(), numbers.end()), numbers.end());
  group.vertices = numbers.size();
  const auto place_of = [&](Number v) {
    return static_cast<std::uint32_t>(std::ranges::lower_bound(numbers, v) - numbers.begin());
  };
  group.triangles.reserve(triangles.size());
  for (const auto& t : triangles)
    group.triangles.push_back({place_of(t[0]), place_of(t[1]), place_of(t[2])});
  return group;
}

template class TriangleGroups<std::uint32_t>;
template class TriangleGroups<std::uint64_t>;
template GroupOfMesh<std::uint32_t> group_of(const std::vector<Triangle>& triangles);
template GroupOfMesh<std::uint64_t> group_of(const std::vector<WideTriangle>& triangles);

}  // namespace isobrick
