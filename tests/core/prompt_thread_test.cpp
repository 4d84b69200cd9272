#include "isobrick/core/prompt_thread.h"

#include <gtest/gtest.h>
#include <sched.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <array>
#include <cstdint>
#include <optional>
#include <thread>

namespace isobrick::test {
namespace {

/// The calling thread's sched_attr as words of 32 bits: size, policy, flags (2), nice, priority,
/// runtime (2), deadline (2), period (2).
using Words = std::array<std::uint32_t, 12>;

/// None where the system does not say.
std::optional<Words> attributes() {
  Words words{};
  if (syscall(SYS_sched_getattr, 0, words.data(), sizeof words, 0) != 0) return std::nullopt;
  return words;
}

/// Whether the system lets a thread set them, were it to what they are.
bool may_set(Words words) { return syscall(SYS_sched_setattr, 0, words.data(), 0) == 0; }

TEST(PromptThread, TurnsAreShortWhileItLivesAndNothingElseChanges) {
  std::thread([] {
    const auto thread = static_cast<id_t>(syscall(SYS_gettid));
    ASSERT_EQ(setpriority(PRIO_PROCESS, thread, 3), 0);
    const std::optional<Words> before = attributes();
    if (!before || !may_set(*before)) GTEST_SKIP() << "threads may not set how they are scheduled";
    if ((*before)[6] == 0 && (*before)[7] == 0) GTEST_SKIP() << "a kernel without turns of threads";
    {
      const PromptThread prompt;
      std::optional<Words> during = attributes();
      ASSERT_TRUE(during);
      EXPECT_EQ((*during)[6], 100'000u);
      EXPECT_EQ((*during)[7], 0u);
      (*during)[6] = (*before)[6];
      EXPECT_EQ(during, before);
      EXPECT_EQ(getpriority(PRIO_PROCESS, thread), 3);
    }
    EXPECT_EQ(attributes(), before);
  }).join();
}

}  // namespace
}  // namespace isobrick::test
