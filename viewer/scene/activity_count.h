#pragma once

#include <chrono>

#include "core/thread_annotations.h"

namespace isobrick::inline v0 {

/// Counts running activities, so that an owner which closes can wait for their end. Thread-safe.
class ActivityCount {
 public:
  /// Returns false after close(): the activity must not begin.
  bool begin() {
    const MutexLock lock(mutex_);
    if (closed_) return false;
    ++count_;
    return true;
  }
  void end() {
    const MutexLock lock(mutex_);
    if (--count_ == 0) idle_.notify_all();
  }
  void close() {
    const MutexLock lock(mutex_);
    closed_ = true;
  }
  /// Waits until no activity runs; returns whether that holds.
  bool wait_for_none(std::chrono::steady_clock::time_point deadline) {
    const MutexLock lock(mutex_);
    while (count_ > 0)
      if (!idle_.wait_until(mutex_, deadline)) break;
    return count_ == 0;
  }

 private:
  Mutex mutex_;
  CondVar idle_;
  int count_ ISOBRICK_GUARDED_BY(mutex_) = 0;
  bool closed_ ISOBRICK_GUARDED_BY(mutex_) = false;
};

}  // namespace isobrick
