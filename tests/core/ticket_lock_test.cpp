#include "core/ticket_lock.h"

#include <gtest/gtest.h>

#include <thread>
#include <vector>

namespace isobrick::inline v0 {
namespace {

TEST(TicketLock, GoesToThreadsInTurn) {
  TicketLock lock;
  constexpr int kRounds = 200;
  std::vector<int> order;  // guarded by the lock
  const auto work = [&](int number) {
    for (int i = 0; i < kRounds; ++i) {
      const TicketGuard guard(&lock);
      order.push_back(number);
      // Long enough for the other one to take the next ticket.
      std::this_thread::sleep_for(std::chrono::microseconds(200));
    }
  };
  std::thread first(work, 1), second(work, 2);
  first.join();
  second.join();
  ASSERT_EQ(order.size(), 2u * kRounds);
  int changes = 0;
  for (std::size_t i = 1; i < order.size(); ++i) changes += order[i] != order[i - 1];
  EXPECT_GT(changes, kRounds) << "they take turns, but for when one was not there in time";
}

TEST(TicketLock, IsOptional) {
  const TicketGuard one(nullptr), another(nullptr);
  TicketLock lock;
  { const TicketGuard guard(&lock); }
  const TicketGuard again(&lock);
}

}  // namespace
}  // namespace isobrick
