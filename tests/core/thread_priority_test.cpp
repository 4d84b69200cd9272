#include "core/thread_priority.h"

#include <gtest/gtest.h>
#include <sys/resource.h>

#include <algorithm>
#include <thread>

namespace isobrick::test {
namespace {

TEST(GiveWay, IsOfTheCallingThreadAlone) {
  const int before = getpriority(PRIO_PROCESS, 0);
  int after = before;
  std::thread([&] {
    lower_thread_priority();
    after = getpriority(PRIO_PROCESS, 0);
  }).join();
  EXPECT_EQ(after, std::min(before + 10, 19));
  EXPECT_EQ(getpriority(PRIO_PROCESS, 0), before);
}

}  // namespace
}  // namespace isobrick::test
