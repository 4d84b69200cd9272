// What closing a stream releases, and when, whatever its threads are doing.

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <thread>
#include <vector>

#include "tests/stream/memory_bricks.h"
#include "tests/viewer/scene/blocking_source.h"
#include "tests/viewer/scene/random_cut.h"
#include "tests/viewer/scene/test_device.h"
#include "viewer/scene/scene_stream.h"

namespace isobrick::test {
namespace {

using Clock = std::chrono::steady_clock;
using std::chrono::milliseconds;

/// Makes empty meshes on a thread of its own, some time after the request.
class SlowDevice final : public TestDevice {
 public:
  explicit SlowDevice(milliseconds time) : time_(time), thread_([this] { run(); }) {}
  ~SlowDevice() override {
    {
      const std::lock_guard lock(mutex_);
      end_ = true;
    }
    change_.notify_all();
    thread_.join();
  }
  bool make(const GridView&, NodeMesh mesh, Callback done) override {
    {
      const std::lock_guard lock(mutex_);
      taken_.emplace_back(std::move(mesh), std::move(done));
      ++asked_;
    }
    change_.notify_all();
    return true;
  }

  void wait_until_asked() {
    std::unique_lock lock(mutex_);
    change_.wait(lock, [&] { return !taken_.empty(); });
  }
  /// Number of requested meshes.
  int requested() const {
    const std::lock_guard lock(mutex_);
    return asked_;
  }
  /// Number of meshes that are alive.
  int held() const { return *held_; }
  std::shared_ptr<const std::atomic<int>> held_count() const { return held_; }

 private:
  struct CountedMesh final : DeviceMesh {
    explicit CountedMesh(std::shared_ptr<std::atomic<int>> c) : count(std::move(c)) { ++*count; }
    ~CountedMesh() override { --*count; }
    std::shared_ptr<std::atomic<int>> count;
  };

  void run() {
    std::unique_lock lock(mutex_);
    for (;;) {
      change_.wait(lock, [&] { return end_ || !taken_.empty(); });
      if (taken_.empty()) return;
      lock.unlock();
      std::this_thread::sleep_for(time_);
      lock.lock();
      std::vector<std::pair<NodeMesh, Callback>> made = std::exchange(taken_, {});
      lock.unlock();
      for (auto& [mesh, done] : made) {
        mesh.device = std::make_shared<const CountedMesh>(held_);
        mesh.device_triangles = 1;
        done(std::move(mesh), "");
      }
      made.clear();
      lock.lock();
    }
  }

  milliseconds time_;
  std::shared_ptr<std::atomic<int>> held_ = std::make_shared<std::atomic<int>>(0);
  mutable std::mutex mutex_;
  std::condition_variable change_;
  std::vector<std::pair<NodeMesh, Callback>> taken_;
  int asked_ = 0;
  bool end_ = false;
  std::thread thread_;
};

class StreamEnd : public testing::Test {
 protected:
  void expect_quick_end() {
    const auto start = Clock::now();
    stream_.reset();
    EXPECT_LT(Clock::now() - start, milliseconds(100));
  }
  void begin(int threads = 2) {
    // Not all bricks fit, so another isovalue has to read.
    stream_ = std::make_unique<SceneStream>(
        source_, tree_, StreamOptions{.threads = threads, .brick_bytes = 4 << 20});
  }
  /// Opens a stream whose device is making a mesh.
  void begin_with(const std::shared_ptr<SlowDevice>& device) {
    begin();
    stream_->set_device(device);
    source_->open();
    want(0);
    device->wait_until_asked();
  }
  void want(double isovalue) { stream_->set_cut(RandomCut(tree_->grid(), 1, 100).cut({isovalue})); }
  /// Whether the stream's threads have ended: they own the source.
  bool threads_end() {
    for (int i = 0; i < 1000 && source_.use_count() > 1; ++i)
      std::this_thread::sleep_for(milliseconds(10));
    return source_.use_count() == 1;
  }

  std::shared_ptr<BlockingSource> source_ =
      std::make_shared<BlockingSource>(std::make_shared<MemoryBricks>(
          Int3{150, 150, 150},
          std::function<float(Int3)>([](Int3 p) { return static_cast<float>(ball(p, 150)); }),
          MemoryBricks::Options{.brick = 16}));
  std::shared_ptr<const NodeTree> tree_ = std::make_shared<const NodeTree>(*source_);
  std::unique_ptr<SceneStream> stream_;
};

TEST_F(StreamEnd, WhileAReadHangsAllElseIsGivenBack) {
  const auto device = std::make_shared<SlowDevice>(milliseconds(0));
  begin();
  stream_->set_device(device);
  source_->open();
  want(0);
  ASSERT_TRUE(stream_->wait_idle(60));
  const std::weak_ptr<const NodeMesh> shown = stream_->drawable()->nodes.front().mesh;
  const std::weak_ptr<const Drawable> drawn = stream_->drawable();
  EXPECT_GT(device->held(), 5);
  const auto brick = [&] {
    std::weak_ptr<const BrickSamples> found;
    for_each_point({{0, 0, 0}, {10, 10, 10}}, [&](Int3 b) {
      if (auto there = stream_->bricks().find(0, b)) found = there;
    });
    return found;
  }();
  EXPECT_FALSE(brick.expired());
  source_->shut();
  want(3);
  source_->wait_until_read();
  expect_quick_end();
  EXPECT_TRUE(shown.expired());
  EXPECT_TRUE(drawn.expired());
  EXPECT_TRUE(brick.expired());
  EXPECT_EQ(device->held(), 0);
  EXPECT_EQ(device.use_count(), 1);
  EXPECT_GT(source_.use_count(), 1) << "the thread that reads needs it";
  source_->open();
  EXPECT_TRUE(threads_end());
}

TEST_F(StreamEnd, AThreadThatWasHeldUpMakesNothingAnyMore) {
  const auto device = std::make_shared<SlowDevice>(milliseconds(0));
  for (const bool with_device : {false, true}) {
    begin(4);
    if (with_device) stream_->set_device(device);
    source_->shut();
    want(0);
    source_->wait_until_read();
    expect_quick_end();
    EXPECT_EQ(device.use_count(), 1);
    const int requested = device->requested();
    source_->open();
    EXPECT_TRUE(threads_end());
    EXPECT_EQ(device->requested(), requested);
    EXPECT_EQ(device->held(), 0);
  }
}

TEST_F(StreamEnd, WaitsForWhatADeviceMakes) {
  const auto device = std::make_shared<SlowDevice>(milliseconds(5));
  begin_with(device);
  expect_quick_end();
  EXPECT_EQ(device->held(), 0);
  EXPECT_EQ(device.use_count(), 1);
  EXPECT_TRUE(threads_end());
}

TEST_F(StreamEnd, WhatADeviceMakesTooLateIsDropped) {
  auto device = std::make_shared<SlowDevice>(milliseconds(300));
  const auto held = device->held_count();
  begin_with(device);
  expect_quick_end();
  EXPECT_GT(device.use_count(), 1) << "it makes what it was sent";
  for (int i = 0; i < 1000 && device.use_count() > 1; ++i)
    std::this_thread::sleep_for(milliseconds(10));
  EXPECT_EQ(device.use_count(), 1);
  EXPECT_TRUE(threads_end());
  device.reset();
  EXPECT_EQ(*held, 0);
}

}  // namespace
}  // namespace isobrick::test
