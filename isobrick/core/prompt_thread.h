#pragma once

#include <cstdint>
#include <optional>

namespace isobrick {

/// While it lives, the thread that made it gets a core soon after it wakes, also where others
/// keep all cores busy: its turns are short, and the scheduler lets who has the shorter turn go
/// first. For threads that hand on what others work on; its share of the cores stays the same.
/// Threads that it makes meanwhile have such turns too.
/// Linux from 6.12 on; elsewhere, and where the system does not allow it, nothing happens.
class PromptThread {
 public:
  PromptThread();
  PromptThread(const PromptThread&) = delete;
  PromptThread& operator=(const PromptThread&) = delete;
  /// By the same thread.
  ~PromptThread();

 private:
  std::optional<std::uint64_t> usual_;  ///< how long its turns were, in ns; none: not changed
};

}  // namespace isobrick
