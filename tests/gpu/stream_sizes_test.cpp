#include "gpu/stream/stream_sizes.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include <isobrick/error.h>

// Sizes of streaming extractions, alone and beside each other, which need no device.

namespace isobrick::inline v0 {
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

TEST(StreamSizes, TheLeastBudgetWorksAndLessIsRefusedByName) {
  const SurfaceOptions options{.roi = kLattice.box()};
  const gpu::StreamSizes least = gpu::stream_sizes(kLattice, options, 1);
  EXPECT_EQ(gpu::fit_stream_sizes(kLattice, options, least.device_bytes, kMuch, 0).tiles, 1u);
  EXPECT_EQ(gpu::fit_stream_sizes(kLattice, options, kMuch, kMuch, 0).tiles,
            gpu::kMaxTilesOfLaunch);
  const auto refusal = [&](std::uint64_t device, std::uint64_t host) -> std::string {
    try {
      gpu::fit_stream_sizes(kLattice, options, device, host, 100);
    } catch (const UsageError& e) {
      return e.what();
    }
    return "";
  };
  EXPECT_NE(refusal(least.device_bytes - 1, kMuch)
                .find("at least " + std::to_string(least.device_bytes) + " bytes (--gpu-memory "),
            std::string::npos);
  const std::uint64_t host = least.pinned_bytes + least.host_bytes + 100;
  EXPECT_EQ(refusal(kMuch, host), "");
  EXPECT_NE(refusal(kMuch, host - 1).find("at least " + std::to_string(host) + " bytes (--memory "),
            std::string::npos);
  EXPECT_LT(least.device_bytes, 32 * kMiB);
}

/// What finds the bricks of tiles goes by the same reach.
TEST(StreamSizes, OptionsThatMakeNoDifferenceDoNotCount) {
  const Lattice lattice{{1024, 1024, 1024}, {32, 32, 32}, ScalarType::u16};
  const auto tile_bricks = [&](const SurfaceOptions& options) {
    return gpu::stream_sizes(lattice, options, 4).tile_bricks;
  };
  const SurfaceOptions plain{.isovalue = 0.5, .roi = lattice.box()};
  SurfaceOptions dropping = plain, missing = plain;
  dropping.drop_degenerate = true;
  missing.may_have_nan = true;
  EXPECT_EQ(tile_bricks(dropping), tile_bricks(plain));
  EXPECT_EQ(tile_bricks(missing), tile_bricks(plain));
  dropping.isovalue = 1;
  EXPECT_GT(tile_bricks(dropping), tile_bricks(plain));
}

TEST(StreamSizes, APoolIsTakenWhereMostOfItFits) {
  const SurfaceOptions options{.roi = kLattice.box()};
  const gpu::PoolSizes wanted{gpu::preferred_pool_bricks(kLattice, 16), 16};
  EXPECT_GE(wanted.bricks, 384u);
  EXPECT_LT(wanted.bricks, 2048u);
  const auto fit = [&](std::uint64_t device, std::uint64_t host) {
    const gpu::StreamSizes s = gpu::fit_stream_sizes(kLattice, options, device, host, 0, wanted);
    EXPECT_LE(s.device_bytes, device);
    EXPECT_LE(s.pinned_bytes + s.host_bytes, host);
    return s;
  };
  const gpu::StreamSizes whole = fit(1024 * kMiB, kMuch), most = fit(400 * kMiB, kMuch),
                         none = fit(200 * kMiB, kMuch), little_host = fit(1024 * kMiB, 20 * kMiB);
  EXPECT_EQ(whole.pool.bricks, wanted.bricks);
  EXPECT_EQ(whole.tiles, gpu::kMaxTilesOfLaunch);
  EXPECT_EQ(whole.sent_bricks, 0u);
  EXPECT_LT(most.pool.bricks, wanted.bricks);
  EXPECT_GT(most.device_bytes + kLattice.brick_bytes(), 400 * kMiB) << "all of the room is used";
  EXPECT_GE(10 * most.pool.bricks, 6 * wanted.bricks);
  EXPECT_EQ(none.pool.bricks, 0u);
  EXPECT_GT(none.sent_bricks, 0u);
  EXPECT_EQ(little_host.pool.bricks, 0u);
  // Eight bricks, all of which one tile needs.
  const Lattice small{{128, 128, 128}, {64, 64, 64}, ScalarType::u16};
  for (std::uint64_t device = 24 * kMiB; device <= 128 * kMiB; device += kMiB / 4) {
    const gpu::StreamSizes s =
        gpu::fit_stream_sizes(small, {.roi = small.box()}, device, kMuch, 0, {8, 4});
    EXPECT_TRUE(s.pool.bricks == 0 || s.pool.bricks >= s.tile_bricks) << device;
  }
  // Small bricks would be many copies.
  EXPECT_EQ(gpu::fit_stream_sizes({{256, 256, 256}, {32, 32, 32}, ScalarType::u8}, options, kMuch,
                                  kMuch, 0, {100, 4})
                .pool.bricks,
            0u);
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
