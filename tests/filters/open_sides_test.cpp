#include "filters/open_sides.h"

#include <cstdint>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "tests/filters/filter_fixture.h"

namespace isobrick::test {
namespace {

template <class Number>
std::uint64_t count_open(OpenSides<Number>& sides) {
  std::uint64_t open = 0;
  VertexPair<Number> before;
  sides.for_each([&](const typename OpenSides<Number>::Side& side) {
    EXPECT_LT(side.lo(), side.hi());
    EXPECT_NE(side.excess, 0);
    EXPECT_TRUE(side.key > before) << "sides are not in order";
    before = side.key;
    open += static_cast<std::uint64_t>(std::abs(side.excess));
  });
  return open;
}

TEST(OpenSides, OfOneTriangleAreThree) {
  OpenSides<std::uint32_t> sides({}, 1 << 20);
  sides.add({7, 3, 5});
  EXPECT_EQ(sides.added(), 3u);
  EXPECT_EQ(count_open(sides), 3u);
}

TEST(OpenSides, TwoSidesOfOneDirectionDoNotCancel) {
  OpenSides<std::uint32_t> sides({}, 1 << 20);
  sides.add({0, 1, 2});
  sides.add({0, 1, 3});  // must run from 1 to 0
  EXPECT_EQ(count_open(sides), 6u);
}

TEST(OpenSides, BetweenEqualVerticesAreNone) {
  OpenSides<std::uint32_t> sides({}, 1 << 20);
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
      OpenSides<std::uint32_t> sides({.page_bytes = 256}, memory);
      for (const Triangle& t : mesh.triangles) sides.add(t);
      EXPECT_EQ(count_open(sides), expected) << memory;
      EXPECT_GE(sides.spills(), memory <= 1 << 11 ? 21u : 0u);
      // Numbers that differ in their higher bits only are those of other vertices.
      OpenSides<std::uint64_t> wide({.page_bytes = 256}, memory);
      for (const Triangle& t : mesh.triangles)
        for (const std::uint64_t shift : {1u, 2u})
          wide.add({t[0] | shift << 33, t[1] | shift << 34, t[2] | shift << 33});
      for (const Triangle& t : mesh.triangles)
        for (const std::uint64_t shift : {1u, 2u})
          wide.add({t[2] | shift << 33, t[1] | shift << 34, t[0] | shift << 33});
      EXPECT_EQ(count_open(wide), 0u) << "both sides of each triangle";
    }
  }
}

TEST(OpenSides, OfVerticesFarBeyond32Bits) {
  constexpr std::uint64_t far = std::uint64_t{1} << 40;
  OpenSides<std::uint64_t> sides({}, 1 << 20);
  sides.add({far + 7, far + 3, 5});
  sides.add({far + 3, far + 7, 6});
  // The same numbers in 32 bits, and another side.
  sides.add({7, 3, 5});
  EXPECT_EQ(sides.added(), 9u);
  std::vector<std::uint64_t> ends;
  sides.for_each([&](const OpenSides<std::uint64_t>::Side& side) {
    ends.push_back(side.lo());
    ends.push_back(side.hi());
  });
  EXPECT_EQ(ends, (std::vector<std::uint64_t>{3, 5, 3, 7, 5, 7, 5, far + 3, 5, far + 7, 6, far + 3,
                                              6, far + 7}));
}

TEST(OpenSides, OfAMeshInOrderNeedNoFile) {
  const Mesh mesh = sphere(100);
  OpenSides<std::uint32_t> sides({.beside = "/no such folder/mesh.ply"}, 1 << 20);
  for (const Triangle& t : mesh.triangles) sides.add(t);
  EXPECT_EQ(sides.spills(), 0u);
  EXPECT_EQ(count_open(sides), 0u);
}

}  // namespace
}  // namespace isobrick::test
