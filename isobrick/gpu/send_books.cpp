#include "isobrick/gpu/send_books.h"

#include <algorithm>
#include <utility>

namespace isobrick::gpu {

SendBooks::SendBooks(int threads, std::size_t buffers_of_thread)
    : orders_(static_cast<std::size_t>(threads), Order(buffers_of_thread)),
      requests_(orders_.size() * buffers_of_thread) {
  std::size_t buffer = 0;
  for (Order& order : orders_)
    for (std::size_t& place : order) place = buffer++;
}

std::optional<std::size_t> SendBooks::begin(int thread) {
  Order& order = order_of(thread);
  const auto found = std::find_if(order.begin(), order.end(), [&](std::size_t buffer) {
    return state_of(buffer) == State::free;
  });
  if (found == order.end()) return std::nullopt;
  std::rotate(order.begin(), found, found + 1);
  return order.front();
}

std::size_t SendBooks::end(int thread, std::byte* place) {
  const std::size_t buffer = order_of(thread).front();
  const std::lock_guard lock(mutex_);
  requests_[buffer] = kEnded;
  ended_.push_back({buffer, place});
  return ended_.size();
}

SendBooks::State SendBooks::state_of(std::size_t buffer) const {
  const std::uint64_t request = requests_[buffer];
  if (request == kEnded) return State::ended;
  return request <= known_over_ ? State::free : State::asked;
}

std::vector<SendBooks::Piece> SendBooks::take_ended() {
  const std::lock_guard lock(mutex_);
  return std::exchange(ended_, {});
}

void SendBooks::asked(const std::vector<Piece>& pieces, std::uint64_t request) {
  for (const Piece& piece : pieces) requests_[piece.buffer] = request;
}

void SendBooks::over(std::uint64_t request) {
  std::uint64_t known = known_over_;
  while (known < request && !known_over_.compare_exchange_weak(known, request)) {
  }
}

}  // namespace isobrick::gpu
