#include "isobrick/core/prompt_thread.h"

#include <sched.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cstdint>
#include <utility>

namespace isobrick {
namespace {

/// The shortest that Linux knows is 0.1 ms, the usual one some 3.
constexpr std::uint64_t kTurn = 100'000;

/// struct sched_attr, which the C library does not have.
struct Attributes {
  std::uint32_t size = sizeof(Attributes), policy = 0;
  std::uint64_t flags = 0;
  std::int32_t nice = 0;
  std::uint32_t priority = 0;
  std::uint64_t runtime = 0, deadline = 0, period = 0;
};
static_assert(sizeof(Attributes) == 48);

/// The calling thread's; none where it has no turns or the system does not say.
std::optional<Attributes> own_attributes() {
  Attributes attributes;
  if (syscall(SYS_sched_getattr, 0, &attributes, sizeof attributes, 0) != 0) return std::nullopt;
  if (attributes.policy != SCHED_OTHER && attributes.policy != SCHED_BATCH) return std::nullopt;
  return attributes;
}

/// Sets how long a turn of the calling thread is, in ns, and says how long it was.
std::optional<std::uint64_t> set_turn(std::uint64_t ns) {
  std::optional<Attributes> attributes = own_attributes();
  if (!attributes) return std::nullopt;
  const std::uint64_t before = std::exchange(attributes->runtime, ns);
  if (syscall(SYS_sched_setattr, 0, &*attributes, 0) != 0) return std::nullopt;
  return before;
}

}  // namespace

PromptThread::PromptThread() : usual_(set_turn(kTurn)) {}

PromptThread::~PromptThread() {
  if (usual_) (void)set_turn(*usual_);
}

}  // namespace isobrick
