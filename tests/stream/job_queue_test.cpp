#include "stream/job_queue.h"

#include <gtest/gtest.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <fstream>
#include <functional>
#include <future>
#include <limits>
#include <memory>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

namespace isobrick::test {
namespace {

constexpr std::chrono::seconds kLong{20};

/// Whether a thread of this process sleeps, by the kernel's state.
bool is_asleep(long thread) {
  std::ifstream stat("/proc/self/task/" + std::to_string(thread) + "/stat");
  // What follows the name, which may hold anything: " S ".
  stat.ignore(std::numeric_limits<std::streamsize>::max(), ')');
  char state = 0;
  return stat >> state && state == 'S';
}

/// A thread that takes the jobs of a queue until the test ends it.
class Worker {
 public:
  explicit Worker(JobQueue& queue)
      : thread_([this, &queue] {
          number_ = syscall(SYS_gettid);
          number_.notify_all();
          queue.run(0);
        }) {}
  /// Once the queue was closed or stopped.
  void join() { thread_.join(); }
  /// Waits until it has nothing to do and sleeps; false when that never happens. Nobody else
  /// holds the queue's lock meanwhile, so what it sleeps in can only be the wait for a job.
  bool waits() {
    number_.wait(0);
    const auto end = std::chrono::steady_clock::now() + kLong;
    while (!is_asleep(number_) && std::chrono::steady_clock::now() < end)
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    return is_asleep(number_);
  }

 private:
  std::atomic<long> number_ = 0;
  std::thread thread_;
};

TEST(JobQueue, WhoWaitsIsToldOfEachJob) {
  JobQueue queue;
  Worker worker(queue);
  const auto expect_done = [&](const std::function<void(JobQueue::Job)>& push) {
    EXPECT_TRUE(worker.waits());
    const auto done = std::make_shared<std::promise<void>>();
    push([done](int) { done->set_value(); });
    EXPECT_EQ(done->get_future().wait_for(kLong), std::future_status::ready);
  };
  expect_done([&](JobQueue::Job job) { queue.push(std::move(job)); });
  expect_done([&](JobQueue::Job job) { queue.push_front(std::move(job)); });
  queue.close();
  worker.join();
}

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
  Worker worker(queue);
  EXPECT_TRUE(worker.waits());
  queue.stop();
  worker.join();
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
