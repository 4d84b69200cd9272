#include "isobrick/gpu/send_books.h"

#include <gtest/gtest.h>

#include <atomic>
#include <optional>
#include <thread>
#include <vector>

namespace isobrick::test {
namespace {

using gpu::SendBooks;
using State = SendBooks::State;

std::byte* place(std::size_t i) { return reinterpret_cast<std::byte*>(i); }

TEST(SendBooks, ABufferIsFreeAgainOnceItsRequestIsOver) {
  SendBooks books(2, 2);
  EXPECT_EQ(books.buffers(), 4u);
  EXPECT_EQ(books.begin(1), 2u);
  EXPECT_EQ(books.begin(1), 2u) << "the same until it was filled";
  EXPECT_EQ(books.end(1, place(10)), 1u);
  EXPECT_EQ(books.state_of(2), State::ended);
  EXPECT_EQ(books.begin(1), 3u);
  EXPECT_EQ(books.end(1, place(11)), 2u);
  EXPECT_EQ(books.begin(1), std::nullopt);
  EXPECT_EQ(books.oldest(1), 2u);
  EXPECT_EQ(books.begin(0), 0u) << "another thread's";

  const std::vector<SendBooks::Piece> first = books.take_ended();
  ASSERT_EQ(first.size(), 2u);
  EXPECT_EQ(first[0].buffer, 2u);
  EXPECT_EQ(first[0].to, place(10));
  EXPECT_EQ(first[1].buffer, 3u);
  EXPECT_EQ(first[1].to, place(11));
  EXPECT_TRUE(books.take_ended().empty());
  EXPECT_EQ(books.state_of(2), State::ended) << "until it is known by which request";
  books.asked(first, 1);
  EXPECT_EQ(books.state_of(2), State::asked);
  EXPECT_EQ(books.request_of(3), 1u);
  EXPECT_EQ(books.begin(1), std::nullopt);

  EXPECT_EQ(books.end(0, place(12)), 1u);
  books.asked(books.take_ended(), 2);
  books.over(1);
  EXPECT_EQ(books.begin(1), 3u) << "what was filled last";
  EXPECT_EQ(books.oldest(1), 2u);
  EXPECT_EQ(books.state_of(0), State::asked);
  books.over(2);
  books.over(1);
  EXPECT_EQ(books.state_of(0), State::free) << "what is over stays over";
}

/// Threads fill buffers with numbers; one that plays the device copies them later.
TEST(SendBooks, NoBufferIsFilledBeforeItWasCopiedAndNothingIsLost) {
  constexpr int kThreads = 4;
  constexpr std::size_t kEach = 3000, kAll = kThreads * kEach;
  SendBooks books(kThreads, 2);
  std::vector<std::atomic<std::size_t>> buffers(books.buffers());
  std::vector<std::size_t> places(kAll + 1);
  std::atomic<int> filling = kThreads;
  std::vector<std::thread> threads;
  for (int t = 0; t < kThreads; ++t)
    threads.emplace_back([&, t] {
      for (std::size_t i = 0; i < kEach; ++i) {
        std::optional<std::size_t> buffer;
        while (!(buffer = books.begin(t))) std::this_thread::yield();
        const std::size_t number = 1 + static_cast<std::size_t>(t) * kEach + i;
        buffers[*buffer] = number;
        books.end(t, reinterpret_cast<std::byte*>(&places[number]));
      }
      --filling;
    });
  std::size_t copied = 0;
  for (std::uint64_t request = 1; copied < kAll; ++request) {
    const bool last = filling == 0;
    const std::vector<SendBooks::Piece> pieces = books.take_ended();
    books.asked(pieces, request);
    std::this_thread::yield();
    for (const SendBooks::Piece& piece : pieces)
      *reinterpret_cast<std::size_t*>(piece.to) = buffers[piece.buffer];
    copied += pieces.size();
    books.over(request);
    ASSERT_TRUE(!last || copied == kAll) << copied;
  }
  for (std::thread& thread : threads) thread.join();
  for (std::size_t i = 1; i <= kAll; ++i) EXPECT_EQ(places[i], i);
}

}  // namespace
}  // namespace isobrick::test
