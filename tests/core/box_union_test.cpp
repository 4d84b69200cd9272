#include "core/box_union.h"

#include <gtest/gtest.h>

#include <limits>

namespace isobrick::inline v0 {
namespace {

struct BoxOfDoubles {
  Vec3d lo, hi;
  friend bool operator==(const BoxOfDoubles&, const BoxOfDoubles&) = default;
};

TEST(BoxUnion, HoldsAllThatWereIncluded) {
  BoxUnion<BoxOfDoubles> all;
  EXPECT_FALSE(all.box());
  EXPECT_FALSE(all.covers({{0, 0, 0}, {0, 0, 0}}));
  all.include({{5, 5, 5}, {6, 5, 7}});
  EXPECT_EQ(all.box(), (BoxOfDoubles{{5, 5, 5}, {6, 5, 7}})) << "the origin is not in it";
  all.include({{-1, 6, 6}, {0, 8, 6}});
  EXPECT_EQ(all.box(), (BoxOfDoubles{{-1, 5, 5}, {6, 8, 7}}));
  EXPECT_TRUE(all.covers({{0, 5, 6}, {6, 8, 6}}));
  EXPECT_FALSE(all.covers({{0, 4, 6}, {6, 8, 6}}));
  EXPECT_FALSE(all.covers({{0, 5, 6}, {6, 8, 8}}));
}

TEST(BoxUnion, BeginsWithABoxThatIsKnown) {
  BoxUnion<BoxOfDoubles> all(BoxOfDoubles{{1, 1, 1}, {2, 2, 2}});
  all.include({{0, 1, 1}, {0, 3, 1}});
  EXPECT_EQ(all.box(), (BoxOfDoubles{{0, 1, 1}, {2, 3, 2}}));
}

TEST(BoxUnion, APlaceThatIsNotANumberWidensNothing) {
  constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
  Vec3f lo{1, 1, 1}, hi{2, 2, 2};
  const Vec3f p{kNaN, 0, 3};
  widen(lo, hi, p, p);
  EXPECT_EQ(lo, (Vec3f{1, 0, 1}));
  EXPECT_EQ(hi, (Vec3f{2, 2, 3}));
}

TEST(BoxUnion, EmptyBoxesAddNothing) {
  constexpr Box3 empty{{7, 7, 7}, {7, 9, 9}}, box{{1, 2, 3}, {4, 5, 6}};
  static_assert(unite(empty, box) == box && unite(box, empty) == box);
  EXPECT_EQ(unite(box, {{0, 3, 3}, {2, 9, 4}}), (Box3{{0, 2, 3}, {4, 9, 6}}));
}

}  // namespace
}  // namespace isobrick
