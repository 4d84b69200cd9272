#include "gpu/memory/upload_tracker.h"

#include <gtest/gtest.h>

#include <atomic>
#include <optional>
#include <thread>
#include <vector>

namespace isobrick::test {
namespace {

using gpu::UploadTracker;
using State = UploadTracker::State;

std::byte* place(std::size_t i) { return reinterpret_cast<std::byte*>(i); }

TEST(UploadTracker, ABufferIsFreeAgainOnceItsRequestIsOver) {
  UploadTracker uploads(2, 2);
  EXPECT_EQ(uploads.buffers(), 4u);
  EXPECT_EQ(uploads.begin(1), 2u);
  EXPECT_EQ(uploads.begin(1), 2u) << "the same until it was filled";
  EXPECT_EQ(uploads.end(1, place(10)), 1u);
  EXPECT_EQ(uploads.state_of(2), State::filled);
  EXPECT_EQ(uploads.begin(1), 3u);
  EXPECT_EQ(uploads.end(1, place(11)), 2u);
  EXPECT_EQ(uploads.begin(1), std::nullopt);
  EXPECT_EQ(uploads.oldest(1), 2u);
  EXPECT_EQ(uploads.begin(0), 0u) << "another thread's";

  const std::vector<UploadTracker::PendingBrick> first = uploads.take_filled();
  ASSERT_EQ(first.size(), 2u);
  EXPECT_EQ(first[0].buffer, 2u);
  EXPECT_EQ(first[0].to, place(10));
  EXPECT_EQ(first[1].buffer, 3u);
  EXPECT_EQ(first[1].to, place(11));
  EXPECT_TRUE(uploads.take_filled().empty());
  EXPECT_EQ(uploads.state_of(2), State::filled) << "until it is known by which request";
  uploads.requested(first, 1);
  EXPECT_EQ(uploads.state_of(2), State::requested);
  EXPECT_EQ(uploads.request_of(3), 1u);
  EXPECT_EQ(uploads.begin(1), std::nullopt);

  EXPECT_EQ(uploads.end(0, place(12)), 1u);
  uploads.requested(uploads.take_filled(), 2);
  uploads.completed(1);
  EXPECT_EQ(uploads.begin(1), 3u) << "what was filled last";
  EXPECT_EQ(uploads.oldest(1), 2u);
  EXPECT_EQ(uploads.state_of(0), State::requested);
  uploads.completed(2);
  uploads.completed(1);
  EXPECT_EQ(uploads.state_of(0), State::free) << "what is over stays over";
}

/// Threads fill buffers with numbers; one that plays the device copies them later.
TEST(UploadTracker, NoBufferIsFilledBeforeItWasCopiedAndNothingIsLost) {
  constexpr int kThreads = 4;
  constexpr std::size_t kEach = 3000, kFullMask = kThreads * kEach;
  UploadTracker uploads(kThreads, 2);
  std::vector<std::atomic<std::size_t>> buffers(uploads.buffers());
  std::vector<std::size_t> places(kFullMask + 1);
  std::atomic<int> filling = kThreads;
  std::vector<std::thread> threads;
  for (int t = 0; t < kThreads; ++t)
    threads.emplace_back([&, t] {
      for (std::size_t i = 0; i < kEach; ++i) {
        std::optional<std::size_t> buffer;
        while (!(buffer = uploads.begin(t))) std::this_thread::yield();
        const std::size_t number = 1 + static_cast<std::size_t>(t) * kEach + i;
        buffers[*buffer] = number;
        uploads.end(t, reinterpret_cast<std::byte*>(&places[number]));
      }
      --filling;
    });
  std::size_t copied = 0;
  for (std::uint64_t request = 1; copied < kFullMask; ++request) {
    const bool last = filling == 0;
    const std::vector<UploadTracker::PendingBrick> pieces = uploads.take_filled();
    uploads.requested(pieces, request);
    std::this_thread::yield();
    for (const UploadTracker::PendingBrick& piece : pieces)
      *reinterpret_cast<std::size_t*>(piece.to) = buffers[piece.buffer];
    copied += pieces.size();
    uploads.completed(request);
    ASSERT_TRUE(!last || copied == kFullMask) << copied;
  }
  for (std::thread& thread : threads) thread.join();
  for (std::size_t i = 1; i <= kFullMask; ++i) EXPECT_EQ(places[i], i);
}

}  // namespace
}  // namespace isobrick::test
