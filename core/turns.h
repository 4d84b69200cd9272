#pragma once

#include <condition_variable>
#include <cstdint>
#include <mutex>

namespace isobrick {

/// A lock that is given out in the order of asking: for threads that take turns with something
/// for which they would otherwise be slowed down together. Thread-safe.
class Turns {
 public:
  /// Waits until all who asked before have had their turn.
  void begin() {
    std::unique_lock lock(mutex_);
    const std::uint64_t own = asked_++;
    change_.wait(lock, [&] { return given_ == own; });
  }
  /// For who has the turn.
  void end() {
    {
      const std::lock_guard lock(mutex_);
      ++given_;
    }
    change_.notify_all();
  }

 private:
  std::mutex mutex_;
  std::condition_variable change_;
  std::uint64_t asked_ = 0, given_ = 0;
};

/// A turn, until it is destroyed. Of nothing: no turn.
class Turn {
 public:
  explicit Turn(Turns* turns) : turns_(turns) {
    if (turns_ != nullptr) turns_->begin();
  }
  ~Turn() {
    if (turns_ != nullptr) turns_->end();
  }
  Turn(const Turn&) = delete;
  Turn& operator=(const Turn&) = delete;

 private:
  Turns* turns_;
};

}  // namespace isobrick
