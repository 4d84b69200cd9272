#include <isobrick/lattice.h>

#include <gtest/gtest.h>

#include <vector>

#include <isobrick/transform.h>
#include "core/copy_box.h"
#include "core/printable.h"

namespace isobrick::inline v0 {
namespace {

TEST(Lattice, TheBricksOfABoxAreThoseThatHoldItsSamples) {
  const Lattice lattice{{50, 40, 30}, {20, 16, 7}, ScalarType::u8};
  for (const Box3 box :
       {Box3{{0, 0, 0}, {1, 1, 1}}, Box3{{19, 15, 6}, {20, 16, 7}}, Box3{{19, 15, 6}, {21, 17, 8}},
        Box3{{20, 16, 7}, {40, 32, 14}}, Box3{{3, 39, 13}, {50, 40, 29}}, lattice.box()}) {
    const Box3 bricks = lattice.bricks_of(box);
    for_each_point({{0, 0, 0}, lattice.bricks()}, [&](Int3 b) {
      EXPECT_EQ(bricks.contains(b), !intersect(lattice.brick_box(b), box).empty());
    });
    EXPECT_TRUE(bricks.contains(lattice.brick_of(box.lo)));
  }
}

TEST(Lattice, BoxesAreCopiedWhereTheyBelong) {
  std::vector<std::byte> from(2 * 5 * 4 * 3), to(2 * 3 * 6 * 2, std::byte{0xee});
  for (std::size_t i = 0; i < from.size(); ++i) from[i] = static_cast<std::byte>(i);
  const Box3 source{{1, 2, 3}, {6, 6, 6}}, target{{3, 1, 4}, {6, 7, 6}};
  const Box3 part{{3, 3, 4}, {6, 6, 5}};
  copy_box({from.data(), source}, {to.data(), target}, part, 2);
  for_each_point(target, [&](Int3 p) {
    const auto at = 2 * static_cast<std::size_t>(linear_index(p - target.lo, target.extent()));
    const auto there = 2 * static_cast<std::size_t>(linear_index(p - source.lo, source.extent()));
    EXPECT_EQ(to[at], part.contains(p) ? from[there] : std::byte{0xee});
    EXPECT_EQ(to[at + 1], part.contains(p) ? from[there + 1] : std::byte{0xee});
  });
}

TEST(Transform, StepsLeadFromSampleToSample) {
  const Transform t{{2, 3, 5}, {7, 8, 9}, {0, -1, 0, 1, 0, 0, 0, 0, 1}, ""};
  const Vec3d base = t.apply({4, 5, 6});
  EXPECT_EQ(base + t.step(0), t.apply({5, 5, 6}));
  EXPECT_EQ(base + t.step(1), t.apply({4, 6, 6}));
  EXPECT_EQ(base + t.step(2), t.apply({4, 5, 7}));
  EXPECT_EQ(t.step(1), (Vec3d{-3, 0, 0}));
  EXPECT_EQ(cross(t.step(0), t.step(1)), (Vec3d{0, 0, 6}));
  EXPECT_EQ(dot(Vec3d{1, 2, 3}, Vec3d{4, 5, 6}), 32);
}

TEST(Printable, NothingOfItLeavesItsLine) {
  EXPECT_EQ(printable("a\n\x1b[31m\x7f\xc3\xa4~ ", 100), "a??[31m???~ ");
  EXPECT_EQ(printable("abcdef", 3), "abc");
  EXPECT_EQ(printable({"a\0b", 3}, 10), "a?b");
}

}  // namespace
}  // namespace isobrick
