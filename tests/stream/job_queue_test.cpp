#include "isobrick/stream/job_queue.h"

#include <gtest/gtest.h>

#include <atomic>
#include <memory>
#include <stdexcept>
#include <thread>
#include <vector>

namespace isobrick::test {
namespace {

TEST(JobQueue, JobsAreDoneInOrderButForThoseThatGoFirst) {
  JobQueue queue;
  std::vector<int> done;
  for (const int i : {1, 2, 3}) queue.push([&done, i](int) { done.push_back(i); });
  queue.push_front([&](int thread) {
    done.push_back(thread);
    queue.push([&](int) { done.push_back(4); });
  });
  queue.close();
  queue.run(7);
  EXPECT_EQ(done, (std::vector{7, 1, 2, 3, 4}));
}

TEST(JobQueue, EachJobIsDoneOnceByOneOfTheThreads) {
  JobQueue queue;
  constexpr int kJobs = 2000, kThreads = 4;
  std::vector<std::atomic<int>> done(kJobs);
  std::vector<std::thread> threads;
  for (int t = 0; t < kThreads; ++t) threads.emplace_back([&, t] { queue.run(t); });
  for (int i = 0; i < kJobs; ++i)
    queue.push([&, i](int thread) {
      EXPECT_LT(thread, kThreads);
      ++done[static_cast<std::size_t>(i)];
    });
  queue.close();
  for (std::thread& thread : threads) thread.join();
  for (const auto& times : done) EXPECT_EQ(times, 1);
}

TEST(JobQueue, WhoWaitsIsStoppedAndWhatIsLeftIsDropped) {
  JobQueue queue;
  std::thread waits([&] { queue.run(0); });
  queue.stop();
  waits.join();
  const auto held = std::make_shared<int>(1);
  queue.push([held](int) { FAIL() << "begun after the stop"; });
  queue.run(0);
  EXPECT_EQ(held.use_count(), 2);
  queue.clear();
  EXPECT_EQ(held.use_count(), 1);
}

TEST(JobQueue, WhatAJobThrowsReachesItsThread) {
  JobQueue queue;
  queue.push([](int) { throw std::runtime_error("no"); });
  EXPECT_THROW(queue.run(0), std::runtime_error);
}

}  // namespace
}  // namespace isobrick::test
