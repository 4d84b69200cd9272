#include "gpu/stream/brick_pool.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <limits>
#include <memory>
#include <thread>
#include <vector>

#include <isobrick/device.h>
#include <isobrick/error.h>
#include "gpu/memory/copy_kernel.h"
#include "gpu/memory/cuda_objects.h"
#include "gpu/stream/stream_sizes.h"
#include "packed/packed_brick.h"
#include "packed/packed_format.h"
#include "tests/packed/fields.h"

namespace isobrick::test {
namespace {

class GpuBrickPool : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!gpu::device_available()) GTEST_SKIP() << "no CUDA device";
    gpu::open_device(0);
  }

  /// Bricks of so many bytes.
  static Lattice lattice_of(std::size_t brick_bytes) {
    const Int3 brick{static_cast<Index>(brick_bytes), 1, 1};
    return {brick, brick, ScalarType::u8};
  }

  static std::byte sample(std::size_t brick, std::size_t at) {
    return static_cast<std::byte>((brick * 131 + at * 7 + (at >> 8)) & 0xff);
  }

  /// A pool of which all is taken.
  struct Pool {
    std::size_t brick_bytes, bricks;
    int threads;
    gpu::BrickPool pool{0, lattice_of(brick_bytes), bricks, threads};
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
  gpu::BrickPool pool(0, lattice_of(kBytes), 8, 2);
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

/// Packed bricks of every type, two threads in turn.
class GpuPackedBricks : public GpuBrickPool, public ::testing::WithParamInterface<ScalarType> {
 protected:
  static constexpr Int3 kBrick{48, 20, 33};
  static constexpr std::size_t kBricks = 150;

  void SetUp() override {
    GpuBrickPool::SetUp();
    if (IsSkipped()) return;
    pool_ = std::make_unique<gpu::BrickPool>(0, lattice_, kBricks, 2, true);
    first_ = pool_->take(kBricks * lattice_.brick_bytes());
  }
  std::vector<std::byte> brick(std::size_t i) const {
    return make_brick(lattice_.type, kBrick, kFields[i % kFields.size()], static_cast<unsigned>(i));
  }
  void send(std::size_t i, std::span<const std::byte> packed, ValueRange<double> range) {
    const int thread = static_cast<int>(i % 2);
    std::copy(packed.begin(), packed.end(), pool_->begin(thread));
    pool_->end_packed(thread, first_ + i * lattice_.brick_bytes(), packed.size(), place(i), range);
  }
  Int3 place(std::size_t i) const {
    const auto n = static_cast<Index>(i);
    return {n % 10, n / 10 % 5, n / 50};
  }
  std::vector<std::byte> found(std::size_t i) {
    const gpu::Stream stream;
    pool_->wait_on(stream);
    std::vector<std::byte> samples(lattice_.brick_bytes());
    gpu::check(cudaMemcpyAsync(samples.data(), first_ + i * samples.size(), samples.size(),
                               cudaMemcpyDeviceToHost, stream.get()));
    stream.wait();
    return samples;
  }

  static constexpr double kInfinity = std::numeric_limits<double>::infinity();
  static constexpr ValueRange<double> kAll{-kInfinity, kInfinity};
  const Lattice lattice_{{471, 100, 99}, kBrick, GetParam()};
  std::unique_ptr<gpu::BrickPool> pool_;
  std::byte* first_ = nullptr;
};

TEST_P(GpuPackedBricks, AreDecoded) {
  for (std::size_t i = 0; i < kBricks; ++i)
    send(i, pack_brick(lattice_.type, kBrick, brick(i)), kAll);
  EXPECT_EQ(pool_->find_damaged(true), std::nullopt);
  for (std::size_t i = 0; i < kBricks; i += 7) EXPECT_EQ(found(i), brick(i)) << i;
}

TEST_P(GpuPackedBricks, WithSamplesOutsideOfTheirRangeAreNamed) {
  const auto constant = make_brick(lattice_.type, kBrick, "constant");  // of threes
  const auto packed = pack_brick(lattice_.type, kBrick, constant);
  for (std::size_t i = 0; i < kBricks; ++i)
    send(i, packed, i == 70 || i == 77 ? ValueRange<double>{4, 9} : ValueRange<double>{3, 3});
  EXPECT_EQ(pool_->find_damaged(true), place(70));
}

TEST_P(GpuPackedBricks, WithADamagedBlockAreNamed) {
  for (std::size_t i = 0; i < kBricks; ++i) {
    auto packed = pack_brick(lattice_.type, kBrick, make_brick(lattice_.type, kBrick, "smooth"));
    // A mask of the first block: it has other planes than there are.
    const std::size_t head = packed::table_bytes(kBrick) + size_of(lattice_.type) + 5;
    if (i == 33) packed[head] ^= std::byte{16};
    send(i, packed, kAll);
  }
  EXPECT_EQ(pool_->find_damaged(true), place(33));
}

INSTANTIATE_TEST_SUITE_P(Types, GpuPackedBricks, ::testing::ValuesIn(kSurfaceTypes),
                         [](const auto& test) { return std::string(zarr_name(test.param)); });

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
