#include "core/morton.h"

#include <gtest/gtest.h>

#include <vector>

namespace isobrick::inline v0 {
namespace {

TEST(Morton, EncodesAndDecodesAllOf21Bits) {
  const Index largest = (Index{1} << 21) - 1;
  for (const Int3 p : {Int3{0, 0, 0}, Int3{1, 0, 0}, Int3{0, 1, 0}, Int3{0, 0, 1},
                       Int3{largest, largest, largest}, Int3{largest, 0, 12345}})
    EXPECT_EQ(morton_decode(morton_encode(p)), p);
  EXPECT_EQ(morton_encode({1, 0, 0}), 1u);
  EXPECT_EQ(morton_encode({0, 1, 0}), 2u);
  EXPECT_EQ(morton_encode({0, 0, 1}), 4u);
}

TEST(Morton, VisitsEveryPointOnceInOrder) {
  for (const Int3 grid :
       {Int3{1, 1, 1}, Int3{5, 3, 7}, Int3{1, 40, 2}, Int3{8, 8, 8}, Int3{0, 3, 3}}) {
    std::vector<std::uint64_t> codes;
    for_each_morton(grid, [&](Int3 p) { codes.push_back(morton_encode(p)); });
    EXPECT_EQ(codes.size(), static_cast<std::size_t>(volume(grid)));
    for (std::size_t i = 1; i < codes.size(); ++i) EXPECT_LT(codes[i - 1], codes[i]);
  }
}

TEST(Morton, SkewedGridsCostNoMoreThanTheirPoints) {
  int points = 0;
  for_each_morton({1, 1, Index{1} << 20}, [&](Int3) { ++points; });
  EXPECT_EQ(points, 1 << 20);
}

}  // namespace
}  // namespace isobrick
