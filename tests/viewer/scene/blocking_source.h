#pragma once

#include <condition_variable>
#include <mutex>

#include "tests/viewer/scene/forwarding_source.h"

namespace isobrick::test {

/// A source whose reads block until open().
class BlockingSource final : public ForwardingSource {
 public:
  using ForwardingSource::ForwardingSource;
  bool read_brick(int level, Int3 brick, std::byte* samples) const override {
    std::unique_lock lock(mutex_);
    reading_ = true;
    change_.notify_all();
    change_.wait(lock, [&] { return open_; });
    return from_->read_brick(level, brick, samples);
  }

  void wait_until_read() {
    std::unique_lock lock(mutex_);
    change_.wait(lock, [&] { return reading_; });
  }
  void open() {
    const std::lock_guard lock(mutex_);
    open_ = true;
    change_.notify_all();
  }
  void shut() {
    const std::lock_guard lock(mutex_);
    open_ = reading_ = false;
  }

 private:
  mutable std::mutex mutex_;
  mutable std::condition_variable change_;
  mutable bool reading_ = false;
  bool open_ = false;
};

}  // namespace isobrick::test
