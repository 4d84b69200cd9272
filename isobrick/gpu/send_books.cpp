#include "isobrick/gpu/send_books.h"

#include <utility>

namespace isobrick::gpu {

SendBooks::SendBooks(int threads, std::size_t buffers_of_thread)
    : buffers_of_thread_(buffers_of_thread),
      next_(static_cast<std::size_t>(threads)),
      requests_(next_.size() * buffers_of_thread) {}

std::size_t SendBooks::buffer_of(int thread) const {
  const auto t = static_cast<std::size_t>(thread);
  return t * buffers_of_thread_ + next_[t];
}

std::size_t SendBooks::end(int thread, std::byte* place) {
  const std::size_t buffer = buffer_of(thread);
  auto& next = next_[static_cast<std::size_t>(thread)];
  next = (next + 1) % buffers_of_thread_;
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
