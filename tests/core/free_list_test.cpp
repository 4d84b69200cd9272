#include "core/free_list.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <set>
#include <utility>

namespace isobrick::inline v0 {
namespace {

TEST(FreeList, TakesTheFirstThatIsLargeEnough) {
  FreeList list(100);
  EXPECT_EQ(list.take(30), 0u);
  EXPECT_EQ(list.take(50), 30u);
  EXPECT_EQ(list.take(21), std::nullopt);
  EXPECT_EQ(list.take(20), 80u);
  EXPECT_EQ(list.take(1), std::nullopt);
  list.give_back(0, 30);
  EXPECT_EQ(list.take(31), std::nullopt);
  EXPECT_EQ(list.take(10), 0u);
  EXPECT_EQ(list.take(20), 10u);
}

TEST(FreeList, PartsThatTouchGrowTogether) {
  FreeList list(90);
  for (int i = 0; i < 3; ++i) list.take(30);
  list.give_back(0, 30);
  list.give_back(60, 30);
  EXPECT_EQ(list.take(31), std::nullopt);
  list.give_back(30, 30);  // between both
  EXPECT_EQ(list.take(90), 0u);
}

TEST(FreeList, ATrimmedPartKeepsItsBeginning) {
  FreeList list(100);
  EXPECT_EQ(list.take(60), 0u);
  EXPECT_EQ(list.take(40), 60u);
  list.trim(0, 60, 20);
  EXPECT_EQ(list.take(41), std::nullopt);
  EXPECT_EQ(list.take(40), 20u);
  list.give_back(0, 20);
  list.give_back(20, 40);
  list.give_back(60, 40);
  EXPECT_EQ(list.take(100), 0u);
}

TEST(FreeList, NothingIsGivenTwiceOrLost) {
  constexpr std::uint32_t kSize = 1000;
  FreeList list(kSize);
  std::mt19937 random(1);
  std::set<std::pair<std::uint32_t, std::uint32_t>> taken;
  for (int round = 0; round < 20000; ++round) {
    if (random() % 2 == 0 && !taken.empty()) {
      const auto one = std::next(taken.begin(), static_cast<long>(random() % taken.size()));
      list.give_back(one->first, one->second);
      taken.erase(one);
      continue;
    }
    const auto size = static_cast<std::uint32_t>(1 + random() % 60);
    if (const auto at = list.take(size)) taken.insert({*at, size});
    std::uint32_t end = 0;
    for (const auto& [at, length] : taken) {
      ASSERT_LE(end, at);
      end = at + length;
    }
    ASSERT_LE(end, kSize);
  }
  for (const auto& [at, size] : taken) list.give_back(at, size);
  EXPECT_EQ(list.take(kSize), 0u);
}

}  // namespace
}  // namespace isobrick
