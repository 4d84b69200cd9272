#pragma once

#include <condition_variable>
#include <memory>
#include <mutex>
#include <utility>

#include "isobrick/viewer/brick_source.h"

namespace isobrick::test {

/// A source whose bricks are read only when they may be.
class HeldUp final : public BrickSource {
 public:
  explicit HeldUp(std::shared_ptr<const BrickSource> from) : from_(std::move(from)) {}
  const StoreInfo& info() const override { return from_->info(); }
  RangeTable brick_ranges(int level, Box3 bricks) const override {
    return from_->brick_ranges(level, bricks);
  }
  RangeTable block_ranges(int level, Box3 blocks) const override {
    return from_->block_ranges(level, blocks);
  }
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
  std::shared_ptr<const BrickSource> from_;
  mutable std::mutex mutex_;
  mutable std::condition_variable change_;
  mutable bool reading_ = false;
  bool open_ = false;
};

}  // namespace isobrick::test
