#include "core/flat_map.h"

#include <gtest/gtest.h>

#include <memory>
#include <random>
#include <string>
#include <unordered_map>

namespace isobrick::testing {
namespace {

TEST(FlatMap, HoldsWhatAStandardMapHolds) {
  std::mt19937_64 random(1);
  // Few keys of many, so that they collide, and keys that lie close together.
  for (const std::uint64_t keys : {7u, 100u, 5000u}) {
    FlatMap<std::uint64_t> map(3);
    std::unordered_map<std::uint64_t, std::uint64_t> expected;
    for (int step = 0; step < 40000; ++step) {
      const std::uint64_t key = random() % keys * (step % 2 ? 1 : 0x100000001ull);
      if (random() % 3 == 0) {
        if (expected.erase(key)) map.erase(key);
      } else {
        const auto [value, added] = map.insert(key);
        EXPECT_EQ(added, expected.count(key) == 0);
        EXPECT_EQ(value, expected[key]);
        expected[key] = value = random();
      }
      ASSERT_EQ(map.size(), expected.size());
      const std::uint64_t other = random() % keys;
      const std::uint64_t* found = map.find(other);
      ASSERT_EQ(found != nullptr, expected.count(other) > 0);
      if (found) {
        ASSERT_EQ(*found, expected[other]);
      }
    }
    for (const auto& [key, value] : expected) {
      ASSERT_TRUE(map.contains(key));
      EXPECT_EQ(*map.find(key), value);
    }
  }
}

TEST(FlatMap, LetsGoOfWhatIsErased) {
  FlatMap<std::shared_ptr<std::string>> map;
  const auto value = std::make_shared<std::string>("held");
  map.insert(5).first = value;
  EXPECT_EQ(value.use_count(), 2);
  map.erase(5);
  EXPECT_EQ(value.use_count(), 1);
  EXPECT_FALSE(map.contains(5));
}

}  // namespace
}  // namespace isobrick::testing
