#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>

namespace isobrick::inline v0 {

/// Jobs for threads that take one after the other. Its lock is held for moments only, so a thread
/// never waits long to take one. Thread-safe.
class JobQueue {
 public:
  /// Gets the number of the thread that runs it.
  using Job = std::function<void(int thread)>;

  void push(Job job);
  /// Before all others.
  void push_front(Job job);
  /// Does jobs as `thread`, and waits where there is none, until stop(), or until close() and
  /// none is left. Throws what a job throws.
  void run(int thread);
  /// No job comes any more.
  void close();
  /// From now on no job is begun.
  void stop();
  /// Drops what was not begun.
  void clear();

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Job> jobs_;
  bool closed_ = false, stopped_ = false;
};

}  // namespace isobrick
