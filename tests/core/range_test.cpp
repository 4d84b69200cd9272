#include <isobrick/range.h>

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>

#include <isobrick/lattice.h>

namespace isobrick::inline v0 {
namespace {

TEST(ValueRange, LeavesNaNOutAndKnowsWhenItIsEmpty) {
  ValueRange<float> range;
  EXPECT_TRUE(range.empty());
  EXPECT_FALSE(range.stabbed_by(0));
  range.include(NAN);
  EXPECT_TRUE(range.empty());
  range.include(3.0f);
  range.include(NAN);
  range.include(-1.0f);
  EXPECT_EQ(range.lo, -1.0f);
  EXPECT_EQ(range.hi, 3.0f);
}

TEST(ValueRange, IsStabbedAboveItsLeastAndUpToItsLargest) {
  ValueRange<std::uint8_t> range;
  range.include(std::uint8_t{10});
  range.include(std::uint8_t{20});
  EXPECT_FALSE(range.stabbed_by(10));
  EXPECT_TRUE(range.stabbed_by(10.001));
  EXPECT_TRUE(range.stabbed_by(20));
  EXPECT_FALSE(range.stabbed_by(20.001));
}

TEST(Lattice, CutsVolumesIntoBricksBlocksAndTiles) {
  const Lattice lattice{{100, 64, 1}, {64, 64, 64}, ScalarType::u16};
  EXPECT_EQ(lattice.bricks(), (Int3{2, 1, 1}));
  EXPECT_EQ(lattice.blocks(), (Int3{7, 4, 1}));
  EXPECT_EQ(lattice.tiles(), (Int3{4, 2, 1}));
  EXPECT_EQ(lattice.brick_box({1, 0, 0}), (Box3{{64, 0, 0}, {100, 64, 1}}));
  EXPECT_EQ(lattice.brick_bytes(), std::size_t{2} * 64 * 64 * 64);
}

TEST(Lattice, VolumesThatOverflowAreNone) {
  EXPECT_EQ(checked_volume({2, 3, 4}), 24);
  EXPECT_FALSE(checked_volume({0, 3, 4}));
  EXPECT_FALSE(checked_volume({-1, -3, 4}));
  EXPECT_FALSE(checked_volume({Index{1} << 40, Index{1} << 40, 1}));
  EXPECT_FALSE(checked_volume({Index{1} << 62, 1, 1}));
  EXPECT_TRUE(checked_volume({Index{1} << 20, Index{1} << 20, Index{1} << 19}));
}

}  // namespace
}  // namespace isobrick
