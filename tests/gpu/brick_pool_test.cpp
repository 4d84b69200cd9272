#include "gpu/stream/brick_pool.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <thread>
#include <vector>

#include <isobrick/device.h>
#include <isobrick/error.h>
#include "gpu/memory/copy_kernel.h"
#include "gpu/memory/cuda_objects.h"
#include "gpu/stream/stream_sizes.h"

namespace isobrick::test {
namespace {

class GpuBrickPool : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!gpu::device_available()) GTEST_SKIP() << "no CUDA device";
    gpu::open_device(0);
  }

  static std::byte sample(std::size_t brick, std::size_t at) {
    return static_cast<std::byte>((brick * 131 + at * 7 + (at >> 8)) & 0xff);
  }

  /// A pool of which all is taken.
  struct Pool {
    std::size_t brick_bytes, bricks;
    int threads;
    gpu::BrickPool pool{0, brick_bytes, bricks, threads};
    std::byte* first = pool.take(brick_bytes * bricks);

    /// The brick is sent by the thread whose turn it is.
    void send(std::size_t brick) {
      const auto thread = static_cast<int>(brick % static_cast<std::size_t>(threads));
      std::byte* const to = pool.begin(thread);
      for (std::size_t i = 0; i < brick_bytes; ++i) to[i] = sample(brick, i);
      pool.end(thread, first + brick * brick_bytes);
    }

    /// Compares what a stream finds in it.
    void expect_all() {
      const gpu::Stream stream;
      pool.wait_on(stream);
      std::vector<std::byte> found(brick_bytes * bricks);
      gpu::check(
          cudaMemcpyAsync(found.data(), first, found.size(), cudaMemcpyDeviceToHost, stream.get()));
      stream.wait();
      for (std::size_t b = 0; b < bricks; ++b)
        for (std::size_t i = 0; i < brick_bytes; ++i)
          if (found[b * brick_bytes + i] != sample(b, i))
            FAIL() << brick_bytes << " bytes, brick " << b << ", byte " << i;
      EXPECT_EQ(pool.bytes(), found.size());
      EXPECT_GT(pool.seconds(), 0);
    }
  };

  /// Fills a pool by some threads at once.
  static void fill(std::size_t brick_bytes, std::size_t bricks, int threads) {
    Pool pool{brick_bytes, bricks, threads};
    EXPECT_THROW(pool.pool.take(1), Error);
    std::vector<std::thread> fillers;
    for (int t = 0; t < threads; ++t)
      fillers.emplace_back([&, t] {
        for (std::size_t b = static_cast<std::size_t>(t); b < bricks;
             b += static_cast<std::size_t>(threads))
          pool.send(b);
      });
    for (std::thread& filler : fillers) filler.join();
    pool.expect_all();
  }
};

TEST_F(GpuBrickPool, WhatSomeThreadsFillLiesInItsPlaces) {
  fill(std::size_t{128} << 10, 200, 4);
  fill(std::size_t{512} << 10, 70, 16);
  fill(16 * 1001, 300, 3);
}

TEST_F(GpuBrickPool, ARequestMayBeMoreThanALaunchOfTheKernelTakes) {
  constexpr std::size_t kBytes = 4096;
  constexpr int kThreads = 24;
  static_assert(kThreads * gpu::BrickPool::buffers_of_thread(kBytes) / 2 > gpu::CopyChunks::kMax,
                "half of all buffers make a request");
  Pool pool{kBytes, 1000, kThreads};
  // By this thread for all of them: none runs out of buffers before, which would make a smaller
  // request.
  for (std::size_t b = 0; b < pool.bricks; ++b) pool.send(b);
  pool.expect_all();
}

TEST_F(GpuBrickPool, BricksOfOddSizesAreCopiedToo) { fill(51 * 51 * 51, 90, 5); }

TEST_F(GpuBrickPool, WhatCannotBeSentReachesEveryone) {
  // Not of whole words, so a copy of its own, which the driver refuses.
  constexpr std::size_t kBytes = 150'001;
  gpu::BrickPool pool(0, kBytes, 8, 2);
  std::memset(pool.begin(0), 1, kBytes);
  pool.end(0, nullptr);
  const gpu::Stream stream;
  EXPECT_THROW(pool.wait_on(stream), Error);
  EXPECT_THROW(pool.wait_on(stream), Error) << "its bricks will never be there";
  // Threads that wait for a buffer get an error rather than wait for ever.
  const auto fill_all = [&] {
    for (std::size_t i = 0; i < 2 * gpu::BrickPool::buffers_of_thread(kBytes); ++i) {
      pool.begin(1);
      pool.end(1, pool.take(0));
    }
  };
  EXPECT_THROW(fill_all(), Error);
  (void)cudaGetLastError();  // or this thread's next launch would report it
}

TEST(GpuBrickPoolSizes, BricksAreDecodedAsFarAheadAsThePoolHasRoom) {
  const Lattice lattice{{1024, 1024, 1024}, {64, 64, 64}, ScalarType::u16};
  // 384 bricks live at a time, and eight a thread are being decoded or belong to launches.
  const auto ahead = [&](std::uint64_t bricks) { return gpu::bricks_ahead(lattice, {bricks, 16}); };
  EXPECT_EQ(ahead(384 + 16 * (8 + 30)), 30u);
  EXPECT_EQ(ahead(384 + 16 * (8 + 24)), 24u);
  EXPECT_EQ(ahead(100), 24u) << "never less";
  EXPECT_EQ(ahead(gpu::preferred_pool_bricks(lattice, 16)), 40u);
  EXPECT_EQ(ahead(100'000), 40u) << "never more";
}

TEST(GpuBrickPoolSizes, AThreadHasTwoToEightBuffers) {
  for (const std::size_t bytes : {1u << 10, 128u << 10, 512u << 10, 1u << 20, 64u << 20}) {
    const std::size_t each = gpu::BrickPool::buffers_of_thread(bytes);
    EXPECT_GE(each, 2u);
    EXPECT_LE(each, 8u);
    if (each > 2) {
      EXPECT_LE(each * bytes, std::size_t{2} << 20) << "stays in a core's cache";
    }
    EXPECT_EQ(gpu::BrickPool::pinned_bytes(bytes, 3), 3 * each * bytes);
  }
}

}  // namespace
}  // namespace isobrick::test
