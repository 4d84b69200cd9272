#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <mutex>
#include <optional>
#include <vector>

namespace isobrick::inline v0::gpu {

/// Tracks the buffers that threads fill with bricks, each its own, and the requests, numbered from
/// 1, that copy them to their places. Thread-safe; uses no device.
class UploadTracker {
 public:
  /// A brick that waits to be copied.
  struct PendingBrick {
    std::size_t buffer;  ///< counted over all threads
    std::byte* to;
  };
  /// A buffer is free to be filled, filled and without a request, or being copied by one.
  enum class State { free, filled, requested };

  UploadTracker(int threads, std::size_t buffers_of_thread);

  std::size_t buffers() const { return requests_.size(); }
  /// A free buffer for `thread` to fill: the one that it filled last, which its cache holds rather
  /// than another. None while all of its buffers wait or are copied. By that thread.
  std::optional<std::size_t> begin(int thread);
  /// The buffer that begin() gave last. By that thread.
  std::size_t latest(int thread) const { return order_of(thread).front(); }
  /// The buffer that `thread` filled longest ago: the first to be free. By that thread.
  std::size_t oldest(int thread) const { return order_of(thread).back(); }
  /// What `thread` has filled since begin() belongs to `place`. How many bricks wait for a request
  /// now. By that thread.
  std::size_t end(int thread, std::byte* place);

  State state_of(std::size_t buffer) const;
  /// The request that copies a requested buffer.
  std::uint64_t request_of(std::size_t buffer) const { return requests_[buffer]; }

  /// All bricks that wait, for a request.
  std::vector<PendingBrick> take_filled();
  /// The request of this number, which has been made, copies these.
  void requested(const std::vector<PendingBrick>& bricks, std::uint64_t request);
  /// That request and all before it have completed: their buffers are free.
  void completed(std::uint64_t request);

 private:
  static constexpr std::uint64_t kFilled = ~std::uint64_t{0};

  using Order = std::vector<std::size_t>;
  const Order& order_of(int thread) const { return orders_[static_cast<std::size_t>(thread)]; }
  Order& order_of(int thread) { return orders_[static_cast<std::size_t>(thread)]; }

  std::vector<Order> orders_;  ///< buffers of each thread, the one that was begun last first
  std::vector<std::atomic<std::uint64_t>> requests_;  ///< of each buffer; kFilled: none yet
  std::atomic<std::uint64_t> completed_ = 0;
  std::mutex mutex_;
  std::vector<PendingBrick> filled_;
};

}  // namespace isobrick::gpu
