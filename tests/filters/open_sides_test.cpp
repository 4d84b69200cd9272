#include "filters/open_sides.h"

#include <cstdint>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "tests/filters/filter_fixture.h"

namespace isobrick::test {
namespace {

std::uint64_t count_open(OpenSides& sides) {
  std::uint64_t open = 0, before = 0;
  sides.for_each([&](const OpenSides::Side& side) {
    EXPECT_LT(side.lo(), side.hi());
    EXPECT_NE(side.excess, 0);
    EXPECT_GT(side.key, before) << "sides are not in order";
    before = side.key;
    open += static_cast<std::uint64_t>(std::abs(side.excess));
  });
  return open;
}

TEST(OpenSides, OfOneTriangleAreThree) {
  OpenSides sides({}, 1 << 20);
  sides.add({7, 3, 5});
  EXPECT_EQ(sides.added(), 3u);
  EXPECT_EQ(count_open(sides), 3u);
}

TEST(OpenSides, TwoSidesOfOneDirectionDoNotCancel) {
  OpenSides sides({}, 1 << 20);
  sides.add({0, 1, 2});
  sides.add({0, 1, 3});  // must run from 1 to 0
  EXPECT_EQ(count_open(sides), 6u);
}

TEST(OpenSides, BetweenEqualVerticesAreNone) {
  OpenSides sides({}, 1 << 20);
  sides.add({4, 4, 9});
  EXPECT_EQ(sides.added(), 2u);
  EXPECT_EQ(count_open(sides), 0u);
}

// A table of sixteen sides, and runs that are merged many times: triangles in random order.
TEST(OpenSides, AreCountedExactlyWhereTheTableIsSmall) {
  std::mt19937 random(3);
  for (const bool is_open : {false, true}) {
    Mesh mesh = sphere(16);
    std::shuffle(mesh.triangles.begin(), mesh.triangles.end(), random);
    if (is_open) mesh.triangles.resize(mesh.triangles.size() / 3 * 2);
    const std::uint64_t expected = open_sides_of(mesh);
    EXPECT_EQ(expected > 0, is_open);
    for (const std::uint64_t memory : {1u << 8, 1u << 11, 1u << 24}) {
      OpenSides sides({.page_bytes = 256}, memory);
      for (const Triangle& t : mesh.triangles) sides.add(t);
      EXPECT_EQ(count_open(sides), expected) << memory;
      EXPECT_GE(sides.spills(), memory <= 1 << 11 ? 21u : 0u);
    }
  }
}

TEST(OpenSides, OfAMeshInOrderNeedNoFile) {
  const Mesh mesh = sphere(100);
  OpenSides sides({.beside = "/no such folder/mesh.ply"}, 1 << 20);
  for (const Triangle& t : mesh.triangles) sides.add(t);
  EXPECT_EQ(sides.spills(), 0u);
  EXPECT_EQ(count_open(sides), 0u);
}

}  // namespace
}  // namespace isobrick::test
