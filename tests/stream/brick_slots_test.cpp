#include "stream/brick_slots.h"

#include <gtest/gtest.h>

#include "core/morton.h"
#include "core/tile.h"

namespace isobrick::test {
namespace {

/// By definition: whether a tile's samples lie in a brick.
bool uses(const Lattice& lattice, Index reach, Int3 tile, Int3 brick) {
  const Index edge = kTileEdge + 1 + reach;
  const Int3 lo = tile * kTileEdge;
  const Box3 samples{lo - Int3{reach, reach, reach}, lo + Int3{edge, edge, edge}};
  return !intersect(intersect(samples, lattice.box()), lattice.brick_box(brick)).empty();
}

TEST(BrickSlots, NextUseIsTheFirstTileThatLooksAtTheBrick) {
  for (const Int3 brick : {Int3{64, 64, 64}, Int3{20, 48, 32}, Int3{16, 200, 33}})
    for (const Index reach : {0, 1}) {
      const Lattice lattice{{170, 100, 65}, brick, ScalarType::u8};
      for_each_point({{0, 0, 0}, lattice.bricks()}, [&](Int3 b) {
        for (const std::uint64_t code : {0, 1, 7, 30, 100}) {
          std::uint64_t expected = kNever;
          for_each_point({{0, 0, 0}, lattice.tiles()}, [&](Int3 t) {
            if (morton_encode(t) >= code && uses(lattice, reach, t, b))
              expected = std::min(expected, morton_encode(t));
          });
          ASSERT_EQ(next_use(lattice, reach, b, code), expected);
        }
      });
    }
}

TEST(BrickSlots, WhatIsNeededLastGoesFirstAndWhatIsHeldStays) {
  const Lattice lattice{{256, 64, 64}, {64, 64, 64}, ScalarType::u8};
  std::vector<std::byte> memory(3 * lattice.brick_bytes());
  BrickSlots slots(lattice, 0);
  slots.add_slots(memory.data(), 3);
  std::byte* const first = slots.place({0, 0, 0});
  EXPECT_EQ(first, memory.data());
  slots.place({1, 0, 0});
  std::byte* const third = slots.place({2, 0, 0});
  EXPECT_EQ(slots.place({3, 0, 0}), nullptr) << "all are held";
  for (const Index x : {1, 2}) slots.release({x, 0, 0});
  EXPECT_EQ(slots.free_slots(), 0u);
  EXPECT_EQ(slots.place({3, 0, 0}), third) << "tiles of brick 1 come before those of 2";
  EXPECT_TRUE(slots.contains({1, 0, 0}));
  EXPECT_FALSE(slots.contains({2, 0, 0}));
  EXPECT_TRUE(slots.hold({1, 0, 0}));
  EXPECT_FALSE(slots.hold({2, 0, 0}));
  EXPECT_EQ(slots.find({0, 0, 0}), first);
}

TEST(BrickSlots, WhatNobodyNeedsAnyMoreIsFreed) {
  const Lattice lattice{{256, 64, 64}, {64, 64, 64}, ScalarType::u8};
  std::vector<std::byte> memory(2 * lattice.brick_bytes());
  BrickSlots slots(lattice, 0);
  slots.add_slots(memory.data(), 2);
  slots.place({0, 0, 0});
  slots.place({1, 0, 0});
  slots.set_absent({1, 0, 0});
  EXPECT_EQ(slots.find({1, 0, 0}), nullptr);
  EXPECT_EQ(slots.free_slots(), 1u);
  slots.release({1, 0, 0});
  EXPECT_TRUE(slots.contains({1, 0, 0})) << "still known to be absent";
  slots.release({0, 0, 0});
  EXPECT_TRUE(slots.contains({0, 0, 0}));
  slots.advance(morton_encode({2, 0, 0}));
  EXPECT_FALSE(slots.contains({0, 0, 0}));
  EXPECT_TRUE(slots.contains({1, 0, 0}));
  EXPECT_EQ(slots.free_slots(), 2u);
  slots.advance(morton_encode({7, 1, 1}) + 1);
  EXPECT_FALSE(slots.contains({1, 0, 0}));
}

TEST(BrickSlots, CountsWhatIsDecodedAgain) {
  const Lattice lattice{{256, 64, 64}, {64, 64, 64}, ScalarType::u8};
  std::vector<std::byte> memory(lattice.brick_bytes());
  BrickSlots slots(lattice, 0);
  slots.add_slots(memory.data(), 1);
  for (const Index x : {0, 1, 0, 2, 0}) {
    slots.place({x, 0, 0});
    if (x == 2)
      slots.set_absent({x, 0, 0});
    else
      slots.count_read({x, 0, 0});
    slots.release({x, 0, 0});
  }
  EXPECT_EQ(slots.reads(), 4u) << "absent bricks are none";
  EXPECT_EQ(slots.bricks_read(), 2u);
}

}  // namespace
}  // namespace isobrick::test
