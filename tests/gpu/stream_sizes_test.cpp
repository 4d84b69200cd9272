#include "isobrick/gpu/stream_sizes.h"

#include <gtest/gtest.h>

#include <vector>

#include "isobrick/core/error.h"

// Sizes of streaming extractions beside each other, which needs no device.

namespace isobrick {
namespace {

constexpr std::uint64_t kMiB = std::uint64_t{1} << 20, kMuch = kMiB << 20;
const Lattice kLattice{{1024, 1024, 1024}, {64, 64, 64}, ScalarType::u16};

/// A mesh with normals, its picture, and a mesh without.
std::vector<SurfaceOptions> surfaces() {
  return {
      {.isovalue = 1, .normals = true, .roi = kLattice.box()},
      {.isovalue = 1, .normals = true, .indexing = Indexing::chunk_local, .roi = kLattice.box()},
      {.isovalue = 2, .roi = kLattice.box()}};
}

TEST(StreamSizes, SeveralSurfacesShareThePoolAndTheBudgets) {
  const gpu::PoolSizes wanted{gpu::preferred_pool_bricks(kLattice, 16), 16};
  for (const auto& [device, host] : {std::pair(kMuch, kMuch), std::pair(600 * kMiB, kMuch),
                                     std::pair(100 * kMiB, kMuch), std::pair(kMuch, 120 * kMiB)}) {
    SCOPED_TRACE(device);
    const auto sizes = gpu::fit_stream_sizes(kLattice, surfaces(), device, host, 0, wanted);
    ASSERT_EQ(sizes.size(), 3u);
    EXPECT_LE(gpu::device_bytes_of(kLattice, sizes), device);
    EXPECT_LE(gpu::host_bytes_of(kLattice, sizes), host);
    std::uint64_t each_with_a_pool = 0;
    for (std::size_t i = 0; i < sizes.size(); ++i) {
      EXPECT_EQ(sizes[i].pool.bricks, sizes[0].pool.bricks);
      EXPECT_EQ(sizes[i].tiles, sizes[0].tiles);
      EXPECT_EQ(sizes[i].device_bytes, gpu::stream_sizes(kLattice, surfaces()[i], sizes[i].tiles,
                                                         sizes[i].in_flight, sizes[i].pool)
                                           .device_bytes);
      each_with_a_pool += sizes[i].device_bytes;
    }
    EXPECT_EQ(gpu::device_bytes_of(kLattice, sizes),
              each_with_a_pool - 2 * sizes[0].pool.bricks * kLattice.brick_bytes());
  }
  EXPECT_GT(
      gpu::fit_stream_sizes(kLattice, surfaces(), kMuch, kMuch, 0, wanted).front().pool.bricks, 0u);
}

TEST(StreamSizes, OneSurfaceIsOneOfSeveral) {
  const SurfaceOptions options = surfaces().front();
  const gpu::PoolSizes wanted{gpu::preferred_pool_bricks(kLattice, 16), 16};
  const auto one = gpu::fit_stream_sizes(kLattice, options, 512 * kMiB, kMuch, 0, wanted);
  const auto list =
      gpu::fit_stream_sizes(kLattice, std::span(&options, 1), 512 * kMiB, kMuch, 0, wanted);
  ASSERT_EQ(list.size(), 1u);
  EXPECT_EQ(one.device_bytes, list[0].device_bytes);
  EXPECT_EQ(gpu::device_bytes_of(kLattice, list), one.device_bytes);
  EXPECT_EQ(gpu::host_bytes_of(kLattice, list), one.pinned_bytes + one.host_bytes);
}

TEST(StreamSizes, TheLeastOfSeveralWorksAndLessIsRefused) {
  std::vector<gpu::StreamSizes> least;
  for (const SurfaceOptions& options : surfaces())
    least.push_back(gpu::stream_sizes(kLattice, options, 1));
  const std::uint64_t bytes = gpu::device_bytes_of(kLattice, least);
  EXPECT_EQ(gpu::fit_stream_sizes(kLattice, surfaces(), bytes, kMuch, 0).front().tiles, 1u);
  EXPECT_THROW(gpu::fit_stream_sizes(kLattice, surfaces(), bytes - 1, kMuch, 0), UsageError);
}

}  // namespace
}  // namespace isobrick
