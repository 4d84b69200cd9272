#include "gpu/memory/upload_tracker.h"

#include <algorithm>
#include <utility>

namespace isobrick::inline v0::gpu {

UploadTracker::UploadTracker(int threads, std::size_t buffers_of_thread)
    : orders_(static_cast<std::size_t>(threads), Order(buffers_of_thread)),
      requests_(orders_.size() * buffers_of_thread) {
  std::size_t buffer = 0;
  for (Order& order : orders_)
    for (std::size_t& place : order) place = buffer++;
}

std::optional<std::size_t> UploadTracker::begin(int thread) {
  Order& order = order_of(thread);
  const auto found = std::find_if(order.begin(), order.end(), [&](std::size_t buffer) {
    return state_of(buffer) == State::free;
  });
  if (found == order.end()) return std::nullopt;
  std::rotate(order.begin(), found, found + 1);
  return order.front();
}

std::size_t UploadTracker::end(int thread, std::byte* place) {
  const std::size_t buffer = order_of(thread).front();
  const std::lock_guard lock(mutex_);
  requests_[buffer] = kFilled;
  filled_.push_back({buffer, place});
  return filled_.size();
}

UploadTracker::State UploadTracker::state_of(std::size_t buffer) const {
  const std::uint64_t request = requests_[buffer];
  if (request == kFilled) return State::filled;
  return request <= completed_ ? State::free : State::requested;
}

std::vector<UploadTracker::PendingBrick> UploadTracker::take_filled() {
  const std::lock_guard lock(mutex_);
  return std::exchange(filled_, {});
}

void UploadTracker::requested(const std::vector<PendingBrick>& bricks, std::uint64_t request) {
  for (const PendingBrick& brick : bricks) requests_[brick.buffer] = request;
}

void UploadTracker::completed(std::uint64_t request) {
  std::uint64_t known = completed_;
  while (known < request && !completed_.compare_exchange_weak(known, request)) {
  }
}

}  // namespace isobrick::gpu
