#include "isobrick/core/prompt_thread.h"

#include <gtest/gtest.h>
#include <sched.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <array>
#include <cstdint>
#include <thread>

namespace isobrick::test {
namespace {

/// The calling thread's sched_attr as words of 32 bits: size, policy, flags (2), nice, priority,
/// runtime (2), deadline (2), period (2).
using Words = std::array<std::uint32_t, 12>;

Words attributes() {
  Words words{};
  EXPECT_EQ(syscall(SYS_sched_getattr, 0, words.data(), sizeof words, 0), 0);
  return words;
}

TEST(PromptThread, TurnsAreShortWhileItLivesAndNothingElseChanges) {
  std::thread([] {
    const auto thread = static_cast<id_t>(syscall(SYS_gettid));
    ASSERT_EQ(setpriority(PRIO_PROCESS, thread, 3), 0);
    const Words before = attributes();
    {
      const PromptThread prompt;
      Words during = attributes();
      // Kernels that know of turns say how long they are.
      if (before[6] != 0) {
        EXPECT_EQ(during[6], 100'000u);
        EXPECT_EQ(during[7], 0u);
      }
      during[6] = before[6];
      EXPECT_EQ(during, before);
      EXPECT_EQ(getpriority(PRIO_PROCESS, thread), 3);
    }
    EXPECT_EQ(attributes(), before);
  }).join();
}

}  // namespace
}  // namespace isobrick::test
