#include "stream/resident_bricks.h"

#include <gtest/gtest.h>

#include <chrono>
#include <cstdint>
#include <functional>
#include <future>
#include <memory>
#include <set>
#include <thread>
#include <vector>

#include <isobrick/error.h>
#include "tests/stream/always.h"
#include "tests/stream/memory_bricks.h"

namespace isobrick::test {
namespace {

/// Bricks one of which, held(), is read only when it may be: whoever is in read_together()
/// meanwhile reads what is wanted soon.
class WantedSoon : public testing::Test {
 protected:
  class Source final : public BrickSource {
   public:
    const StoreInfo& info() const override { return bricks.info(); }
    RangeTable brick_ranges(int level, Box3 box) const override {
      return bricks.brick_ranges(level, box);
    }
    RangeTable block_ranges(int level, Box3 box) const override {
      return bricks.block_ranges(level, box);
    }
    bool read_brick(int level, Int3 brick, std::byte* samples) const override {
      if (brick == held()) may_read.get_future().wait();
      return bricks.read_brick(level, brick, samples);
    }
    void will_need(int level, Int3 brick) const override {
      ++hints;
      bricks.will_need(level, brick);
    }

    MemoryBricks bricks{
        {128, 128, 128},
        std::function<float(Int3)>([](Int3 p) { return static_cast<float>(p.x + 1); }),
        MemoryBricks::Options{}};
    mutable std::promise<void> may_read;
    mutable int hints = 0;
  };

  static constexpr Int3 held() { return {0, 0, 3}; }
  static constexpr std::uint64_t kBrick = sizeof(float) * 32 * 32 * 32;
  /// A budget of which so many bricks can be wanted soon; beside it is what ranges take.
  static std::uint64_t budget_for(std::uint64_t soon) { return 8 * soon * kBrick * 16 / 15 + 16; }

  /// Reads held() and one other together, and what is wanted soon until nothing is left of it.
  void read_soon(ResidentBricks& bricks) {
    const std::vector<Int3> now{held(), {1, 0, 3}};
    const std::uint64_t before = bricks.counters().reads;
    const auto read = [&] { bricks.read_together(0, now, Always()); };
    const auto first = std::async(std::launch::async, read),
               second = std::async(std::launch::async, read);
    // Until no more is read for a while.
    std::uint64_t reads = before;
    for (int still = 0; still < 20 || reads == before; ++still) {
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
      if (bricks.counters().reads != reads) still = 0;
      reads = bricks.counters().reads;
    }
    source_->may_read.set_value();
    first.wait();
    second.wait();
  }
  /// Those of level 0 with z = 0 and z = 1 that are there, as numbers from 0 on.
  static std::set<int> there(ResidentBricks& bricks) {
    std::set<int> found;
    for (int i = 0; i < 32; ++i)
      if (bricks.find(0, brick(i)) != nullptr) found.insert(i);
    return found;
  }
  static Int3 brick(int i) { return {i % 4, i / 4 % 4, i / 16}; }

  std::shared_ptr<Source> source_ = std::make_shared<Source>();
};

TEST_F(WantedSoon, IsReadOnceHoweverOftenItIsNamed) {
  ResidentBricks bricks(source_, budget_for(4));
  for (int round = 0; round < 3; ++round)
    for (int i = 0; i < 4; ++i) bricks.will_need(0, brick(i));
  EXPECT_EQ(source_->hints, 4);
  read_soon(bricks);
  EXPECT_EQ(there(bricks), (std::set<int>{0, 1, 2, 3})) << "the first ones had room all the same";
  EXPECT_EQ(bricks.counters().reads, 6u);
}

TEST_F(WantedSoon, WhatWasNamedFirstGoesForWhatWasNamedLast) {
  ResidentBricks bricks(source_, budget_for(4));
  for (int i = 0; i < 10; ++i) bricks.will_need(0, brick(i));
  EXPECT_EQ(source_->hints, 10);
  read_soon(bricks);
  EXPECT_EQ(there(bricks), (std::set<int>{6, 7, 8, 9}));
}

TEST_F(WantedSoon, WhatHasBeenReadTakesNoRoomAmongThem) {
  ResidentBricks bricks(source_, budget_for(4));
  for (int i = 0; i < 4; ++i) bricks.will_need(0, brick(i));
  for (int i = 1; i < 4; ++i) (void)bricks.get(0, brick(i), Always());
  for (int i = 4; i < 7; ++i) bricks.will_need(0, brick(i));
  read_soon(bricks);
  EXPECT_EQ(there(bricks), (std::set<int>{0, 1, 2, 3, 4, 5, 6}));
  EXPECT_EQ(bricks.counters().reads, 9u) << "each once";
}

TEST_F(WantedSoon, IsNamedAgainWhenItHasBeenDropped) {
  ResidentBricks bricks(source_, budget_for(1));
  bricks.will_need(0, brick(0));
  for (int i = 0; i < 9; ++i) (void)bricks.get(0, brick(i), Always());
  ASSERT_EQ(bricks.find(0, brick(0)), nullptr) << "the budget is too large";
  EXPECT_EQ(source_->hints, 1);
  bricks.will_need(0, brick(0));
  EXPECT_EQ(source_->hints, 2);
}

TEST_F(WantedSoon, SaysThatItCannotBeReadToWhoeverGetsIt) {
  source_->bricks.damage(0, brick(1));
  ResidentBricks bricks(source_, budget_for(4));
  for (int i = 0; i < 3; ++i) bricks.will_need(0, brick(i));
  read_soon(bricks);
  EXPECT_EQ(there(bricks), (std::set<int>{0, 2}));
  EXPECT_EQ(bricks.counters().reads, 5u);
  for (int i = 0; i < 2; ++i) EXPECT_THROW((void)bricks.get(0, brick(1), Always()), DamageError);
  EXPECT_EQ(bricks.counters().reads, 5u) << "what is damaged is not read twice";
}

TEST_F(WantedSoon, IsNotReadWhereThereIsNoRoomForIt) {
  ResidentBricks bricks(source_, budget_for(2));  // 16 bricks
  std::vector<std::shared_ptr<const BrickSamples>> in_use;
  for (int i = 0; i < 15; ++i) in_use.push_back(bricks.get(0, brick(i), Always()));
  for (int i = 20; i < 22; ++i) bricks.will_need(0, brick(i));
  read_soon(bricks);
  EXPECT_EQ(bricks.counters().reads, 17u);
  EXPECT_EQ(bricks.counters().peak_bytes, 17 * kBrick) << "as much as is requested, and no more";
}

}  // namespace
}  // namespace isobrick::test
