#pragma once

#include <sys/resource.h>

namespace isobrick {

/// From now on the calling thread gives way, where cores are short, to those that have not called
/// this: for threads that keep all cores at work beside one that draws. Threads that it makes later
/// inherit that. It cannot be taken back.
/// On Linux; elsewhere, and where the system does not allow it, nothing happens.
inline void give_way() noexcept {
#ifdef __linux__
  constexpr int kBehind = 10;  // about a tenth of the others' share
  // On Linux a priority is a thread's own, and 0 is the calling one.
  (void)setpriority(PRIO_PROCESS, 0, getpriority(PRIO_PROCESS, 0) + kBehind);
#endif
}

}  // namespace isobrick
