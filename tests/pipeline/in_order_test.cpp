#include "pipeline/in_order.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <memory>
#include <stdexcept>

namespace isobrick::inline v0 {
namespace {

/// Something that is under way; `value` counts who holds it.
struct Thing {
  int number = -1;
  std::shared_ptr<int> value;
};

TEST(InOrder, DeliversInTheOrderOfTakingWithNoMoreUnderWay) {
  constexpr int kThings = 500;
  constexpr std::size_t kInFlight = 5;
  int taken = 0, delivered = 0;
  std::atomic<long> under_way = 0, most = 0;
  run_in_order<Thing>(
      kInFlight,
      [&](Thing& t) {
        EXPECT_EQ(t.number, -1) << "as new";
        if (taken == kThings) return false;
        t.number = taken++;
        most = std::max<long>(most, ++under_way);
        return true;
      },
      [](Thing& t) { t.value = std::make_shared<int>(2 * t.number); },
      [&](const Thing& t) {
        EXPECT_EQ(t.number, delivered++);
        EXPECT_EQ(*t.value, 2 * t.number);
        --under_way;
      });
  EXPECT_EQ(delivered, kThings);
  EXPECT_LE(most, static_cast<long>(kInFlight));
}

TEST(InOrder, FreesWhatIsUnderWayWhenAnythingThrows) {
  for (const int who : {0, 1, 2}) {
    for (int round = 0; round < 20; ++round) {
      const auto held = std::make_shared<int>(0);
      int taken = 0;
      const auto fail = [&](const Thing& t, int step) {
        if (step == who && t.number == 40) throw std::runtime_error("enough");
      };
      EXPECT_THROW(run_in_order<Thing>(
                       8,
                       [&](Thing& t) {
                         t.number = taken++;
                         fail(t, 0);
                         return true;
                       },
                       [&](Thing& t) {
                         t.value = held;
                         fail(t, 1);
                       },
                       [&](const Thing& t) { fail(t, 2); }),
                   std::runtime_error);
      EXPECT_EQ(held.use_count(), 1);
    }
  }
}

}  // namespace
}  // namespace isobrick
