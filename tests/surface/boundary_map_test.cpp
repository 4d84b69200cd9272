#include "surface/boundary_map.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "core/morton.h"

namespace isobrick::inline v0 {
namespace {

/// The most boundaries that a map holds while all tiles of a grid come in Morton order.
std::size_t peak_of(Int3 grid) {
  BoundaryMap map(grid);
  std::size_t peak = 0;
  for_each_morton(grid, [&](Int3 tile) {
    map.add(tile);
    map.forget_before(tile);
    peak = std::max(peak, map.size());
  });
  return peak;
}

void expect_bounded(Int3 grid) {
  EXPECT_LE(peak_of(grid), BoundaryMap::max_size(grid))
      << grid.x << "×" << grid.y << "×" << grid.z << " tiles";
}

TEST(BoundaryMap, SmallGridsStayBelowTheirBound) {
  for_each_point({{1, 1, 1}, {10, 10, 10}}, expect_bounded);
}

TEST(BoundaryMap, GridsStayBelowTheirBound) {
  for (const Int3 grid : {Int3{16, 16, 16}, Int3{17, 17, 17}, Int3{33, 33, 33}, Int3{64, 31, 17},
                          Int3{144, 144, 1}, Int3{145, 1, 129}, Int3{1, 150, 90}, Int3{100, 100, 2},
                          Int3{3, 100, 100}, Int3{90, 5, 70}, Int3{500, 1, 1}, Int3{1, 1, 500}})
    expect_bounded(grid);
}

// What waits in a flat grid does not grow with its area.
TEST(BoundaryMap, FlatGridsHoldLittle) {
  EXPECT_LT(BoundaryMap::max_size({1000, 1000, 1}), 6000u);
  EXPECT_LT(BoundaryMap::max_size({1, 1000, 1000}), 6000u);
  EXPECT_LT(BoundaryMap::max_size({1000, 2, 1000}), 12000u);
  EXPECT_EQ(BoundaryMap::max_size({16, 16, 16}), 3u * 16 * 16) << "of a cube: three faces";
}

}  // namespace
}  // namespace isobrick
