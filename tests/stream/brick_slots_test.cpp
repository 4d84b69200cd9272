#include "stream/brick_slots.h"

#include <gtest/gtest.h>

#include <memory>
#include <vector>

#include "core/morton.h"
#include "core/tile.h"
#include "stream/batch_bricks.h"

namespace isobrick::test {
namespace {

/// By definition: whether a tile's samples lie in a brick.
bool uses(const Lattice& lattice, Index reach, Int3 tile, Int3 brick) {
  const Index edge = kTileEdge + 1 + reach;
  const Int3 lo = tile * kTileEdge;
  const Box3 samples{lo - Int3{reach, reach, reach}, lo + Int3{edge, edge, edge}};
  return !intersect(intersect(samples, lattice.box()), lattice.brick_box(brick)).empty();
}

std::shared_ptr<std::byte> slot_memory(const Lattice& lattice, std::size_t bricks) {
  return {new std::byte[bricks * lattice.brick_bytes()], std::default_delete<std::byte[]>()};
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
  const auto memory = slot_memory(lattice, 3);
  BrickSlots slots(lattice, 0);
  slots.add_slots(memory, 3);
  std::byte* const first = slots.place({0, 0, 0});
  EXPECT_EQ(first, memory.get());
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
  const auto memory = slot_memory(lattice, 2);
  BrickSlots slots(lattice, 0);
  slots.add_slots(memory, 2);
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
  const auto memory = slot_memory(lattice, 1);
  BrickSlots slots(lattice, 0);
  slots.add_slots(memory, 1);
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

TEST(BatchBricks, HoldsResidentBricksBeforeItDropsOthersAndCountsWhatItLoads) {
  const Lattice lattice{{256, 64, 64}, {64, 64, 64}, ScalarType::u8};
  BrickSlots slots(lattice, 0);
  slots.add_slots(slot_memory(lattice, 3), 3);
  const auto load_all = [](BatchBricks& batch) {
    std::vector<Int3> loaded;
    while (batch.missing() > 0) loaded.push_back(batch.place().brick);
    batch.set_decoded();
    return loaded;
  };
  const std::byte* first = nullptr;
  {
    BatchBricks batch(slots, std::vector<Int3>{{0, 0, 0}, {1, 0, 0}, {2, 0, 0}}, {0, 0, 0});
    EXPECT_EQ(batch.loads(), 3u);
    EXPECT_EQ(load_all(batch), (std::vector<Int3>{{0, 0, 0}, {1, 0, 0}, {2, 0, 0}}));
    first = batch.find({0, 0, 0});
    EXPECT_NE(first, nullptr);
  }
  EXPECT_EQ(slots.reads(), 3u);
  {
    // No tile after the last one needs brick 0, but this batch does.
    BatchBricks batch(slots, std::vector<Int3>{{3, 0, 0}, {0, 0, 0}}, {7, 1, 1});
    EXPECT_EQ(batch.loads(), 1u);
    EXPECT_FALSE(slots.contains({1, 0, 0}));
    const BrickLoad load = batch.place();
    EXPECT_EQ(load.brick, (Int3{3, 0, 0}));
    batch.set_absent(load.brick);
    batch.set_decoded();
    EXPECT_EQ(batch.find({0, 0, 0}), first);
    EXPECT_EQ(batch.find({3, 0, 0}), nullptr) << "absent";
    BatchBricks others(slots, std::vector<Int3>{{1, 0, 0}, {2, 0, 0}, {3, 0, 0}}, {7, 1, 1});
    EXPECT_EQ(others.loads(), 2u);
    for (int i = 0; i < 2; ++i) EXPECT_NE(others.place().slot, nullptr);
    EXPECT_EQ(others.missing(), 0u);
    EXPECT_EQ(slots.place({2, 0, 0}), nullptr) << "all are held";
  }
  EXPECT_EQ(slots.reads(), 3u) << "absent bricks are none";
  EXPECT_EQ(slots.free_slots(), 3u) << "no tile is left";
}

}  // namespace
}  // namespace isobrick::test
