#include "core/partition_point.h"

#include <gtest/gtest.h>

namespace isobrick::inline v0 {
namespace {

TEST(PartitionPoint, CountsWhatComesBeforeTheFirstFailure) {
  for (std::uint32_t n = 0; n < 40; ++n)
    for (std::uint32_t count = 0; count <= n; ++count)
      EXPECT_EQ(partition_point(n, [&](std::uint32_t i) { return i < count; }), count) << n;
}

TEST(PartitionPoint, WorksWhereASumOfTwoPlacesWouldOverflow) {
  constexpr std::uint32_t kMax = 0xffffffffu;
  EXPECT_EQ(partition_point(kMax, [](std::uint32_t i) { return i < kMax - 3; }), kMax - 3);
}

TEST(PartitionPoint, LooksAtNoPlaceBehindTheEnd) {
  partition_point(7, [](std::uint32_t i) {
    EXPECT_LT(i, 7u);
    return true;
  });
}

}  // namespace
}  // namespace isobrick
