#include "pipeline/extract/sink_writers.h"

#include <atomic>
#include <chrono>
#include <latch>
#include <stdexcept>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

namespace isobrick::test {
namespace {

class CountingSink final : public MeshSink {
 public:
  Indexing indexing() const override { return Indexing::welded; }
  void begin(const MeshHeader&) override {}
  void write(const MeshChunk& chunk) override { taken += chunk.positions.size_bytes(); }
  void finish() override { finished = true; }
  std::uint64_t bytes() const override { return taken; }

  std::atomic<std::uint64_t> taken = 0;
  bool finished = false;
};

class WriteTogether : public ::testing::Test {
 protected:
  WriteTogether() {
    for (CountingSink& sink : sinks_) pointers_.push_back(&sink);
  }
  void write_chunk(MeshSink& sink) { sink.write({0, vertices_, {}, {}}); }
  /// Writes until the write is stopped: without that the test hangs.
  void write_for_ever(MeshSink& sink) {
    for (;;) {
      write_chunk(sink);
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
  }

  std::vector<CountingSink> sinks_{3};
  std::vector<MeshSink*> pointers_;
  std::vector<Vec3f> vertices_{10};
};

TEST_F(WriteTogether, WritesAtTheSameTimeFinishesAndCounts) {
  std::latch all(3);
  std::vector<std::uint64_t> counts(3);
  write_together(
      pointers_,
      [&](std::size_t i, MeshSink& sink) {
        all.arrive_and_wait();  // for ever, if one came after the other
        for (std::size_t n = 0; n <= i; ++n) write_chunk(sink);
      },
      [&](std::size_t i, std::uint64_t bytes) { counts[i] += bytes; });
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_TRUE(sinks_[i].finished);
    EXPECT_EQ(sinks_[i].taken, (i + 1) * 120);
    EXPECT_EQ(counts[i], (i + 1) * 120);
  }
}

TEST_F(WriteTogether, AFailureStopsTheOthersAndIsTheOneThrown) {
  EXPECT_THROW(write_together(
                   pointers_,
                   [&](std::size_t i, MeshSink& sink) {
                     if (i == 2) throw std::runtime_error("full");
                     write_for_ever(sink);
                   },
                   [](std::size_t, std::uint64_t) {}),
               std::runtime_error);
  for (const CountingSink& sink : sinks_) EXPECT_FALSE(sink.finished);
}

TEST_F(WriteTogether, WhatTheCallbackThrowsStopsAll) {
  EXPECT_THROW(write_together(
                   pointers_, [&](std::size_t, MeshSink& sink) { write_for_ever(sink); },
                   [](std::size_t, std::uint64_t) { throw std::logic_error("interrupted"); }),
               std::logic_error);
  for (const CountingSink& sink : sinks_) EXPECT_FALSE(sink.finished);
}

}  // namespace
}  // namespace isobrick::test
