#pragma once

#include <condition_variable>
#include <cstdint>
#include <mutex>

namespace isobrick::inline v0 {

/// A fair mutex: threads get it in the order in which they called lock().
class TicketLock {
 public:
  void lock() {
    std::unique_lock guard(mutex_);
    const std::uint64_t own = next_ticket_++;
    change_.wait(guard, [&] { return serving_ == own; });
  }
  void unlock() {
    {
      const std::lock_guard guard(mutex_);
      ++serving_;
    }
    change_.notify_all();
  }

 private:
  std::mutex mutex_;
  std::condition_variable change_;
  std::uint64_t next_ticket_ = 0, serving_ = 0;
};

/// Holds a TicketLock while it lives; a null pointer is no lock.
class TicketGuard {
 public:
  explicit TicketGuard(TicketLock* lock) : lock_(lock) {
    if (lock_ != nullptr) lock_->lock();
  }
  ~TicketGuard() {
    if (lock_ != nullptr) lock_->unlock();
  }
  TicketGuard(const TicketGuard&) = delete;
  TicketGuard& operator=(const TicketGuard&) = delete;

 private:
  TicketLock* lock_;
};

}  // namespace isobrick
