#pragma once

#include <chrono>
#include <condition_variable>
#include <mutex>

// Locks that Clang's thread-safety analysis checks (-Wthread-safety). The attributes are described
// at https://clang.llvm.org/docs/ThreadSafetyAnalysis.html; other compilers ignore them.

#if defined(__clang__)
#define ISOBRICK_THREAD_ANNOTATION(...) __attribute__((__VA_ARGS__))
#else
#define ISOBRICK_THREAD_ANNOTATION(...)
#endif

/// A class whose objects are locks.
#define ISOBRICK_CAPABILITY(name) ISOBRICK_THREAD_ANNOTATION(capability(name))
/// A class whose objects hold a lock while they live.
#define ISOBRICK_SCOPED_CAPABILITY ISOBRICK_THREAD_ANNOTATION(scoped_lockable)
/// A member that is read and written only by threads that hold the lock.
#define ISOBRICK_GUARDED_BY(mutex) ISOBRICK_THREAD_ANNOTATION(guarded_by(mutex))
/// A function that is called only by threads that hold the locks.
#define ISOBRICK_REQUIRES(...) ISOBRICK_THREAD_ANNOTATION(requires_capability(__VA_ARGS__))
/// A function that is called only by threads that do not hold the locks.
#define ISOBRICK_EXCLUDES(...) ISOBRICK_THREAD_ANNOTATION(locks_excluded(__VA_ARGS__))
/// A function that takes the locks and does not give them back.
#define ISOBRICK_ACQUIRE(...) ISOBRICK_THREAD_ANNOTATION(acquire_capability(__VA_ARGS__))
/// A function that gives the locks back.
#define ISOBRICK_RELEASE(...) ISOBRICK_THREAD_ANNOTATION(release_capability(__VA_ARGS__))

namespace isobrick::inline v0 {

/// std::mutex, known to the analysis.
class ISOBRICK_CAPABILITY("mutex") Mutex {
 public:
  void lock() ISOBRICK_ACQUIRE() { mutex_.lock(); }
  void unlock() ISOBRICK_RELEASE() { mutex_.unlock(); }

 private:
  friend class CondVar;
  std::mutex mutex_;
};

/// Holds a mutex until it is destroyed.
class ISOBRICK_SCOPED_CAPABILITY MutexLock {
 public:
  explicit MutexLock(Mutex& mutex) ISOBRICK_ACQUIRE(mutex) : mutex_(mutex) { mutex_.lock(); }
  ~MutexLock() ISOBRICK_RELEASE() { mutex_.unlock(); }
  MutexLock(const MutexLock&) = delete;
  MutexLock& operator=(const MutexLock&) = delete;

 private:
  Mutex& mutex_;
};

/// std::condition_variable. Waits wake up early at times: call them in a loop that tests the
/// condition, which the analysis sees, as it does not see one in a lambda.
class CondVar {
 public:
  void notify_one() { condition_.notify_one(); }
  void notify_all() { condition_.notify_all(); }

  void wait(Mutex& mutex) ISOBRICK_REQUIRES(mutex) {
    std::unique_lock<std::mutex> lock(mutex.mutex_, std::adopt_lock);
    condition_.wait(lock);
    lock.release();
  }
  /// False once the deadline has passed.
  bool wait_until(Mutex& mutex, std::chrono::steady_clock::time_point deadline)
      ISOBRICK_REQUIRES(mutex) {
    std::unique_lock<std::mutex> lock(mutex.mutex_, std::adopt_lock);
    const std::cv_status status = condition_.wait_until(lock, deadline);
    lock.release();
    return status == std::cv_status::no_timeout;
  }

 private:
  std::condition_variable condition_;
};

}  // namespace isobrick
