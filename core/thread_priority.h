#pragma once

#include <sys/resource.h>

namespace isobrick::inline v0 {

/// Gives the calling thread, and threads that it starts later, a lower share of busy cores, for
/// good. For workers beside a thread that draws.
/// Linux only; does nothing elsewhere and where the system refuses.
inline void lower_thread_priority() noexcept {
#ifdef __linux__
  constexpr int kNice = 10;  // about a tenth of the others' share
  // On Linux a priority is a thread's own, and 0 is the calling one.
  (void)setpriority(PRIO_PROCESS, 0, getpriority(PRIO_PROCESS, 0) + kNice);
#endif
}

}  // namespace isobrick
