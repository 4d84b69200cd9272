#include <gtest/gtest.h>

#include <array>
#include <chrono>
#include <random>

#include "isobrick/gpu/tile_kernel.h"
#include "tests/gpu/busy_device.h"
#include "tests/gpu/resident.h"

// Extractions that stay on the device for the next isovalue make what others make.

namespace isobrick::testing {
namespace {

using namespace std::chrono_literals;

/// Nobody comes too late.
constexpr auto kLong = 300ms;

/// Whether 49 tiles have their blocks at a time, as with 132 multiprocessors of 228 KiB. Tests make
/// the same meshes on other devices, but by launches of their own.
bool has_many_blocks() {
  return gpu::launch_shapes({ScalarType::f32, true}).slabs.blocks >= 49 * gpu::kSlabsOfTile;
}

template <class T>
class GpuStanding : public DeviceTest<T> {};

TYPED_TEST_SUITE(GpuStanding, DeviceTypes);

TYPED_TEST(GpuStanding, MakesTheSameMeshes) {
  const double mid = this->lowest() + 100;
  Resident<TypeParam> r(this->waves({67, 41, 75}));
  for (const bool normals : {false, true}) {
    r.options.normals = normals;
    for (const auto search : {gpu::TileSearch::ranges, gpu::TileSearch::none,
                              gpu::TileSearch::kdtree, gpu::TileSearch::octree}) {
      gpu::ResidentExtractor extractor(r.volume, r.options, {.search = search, .patience = kLong});
      // A mesh is looked at after others have been made by the same launch; some need more room
      // than there is, and there is nothing at one.
      for (const double last : {mid - 60, mid, mid + 0.5, mid + 35}) {
        for (const double isovalue : {mid + 75, mid - 20.5, mid + 3, 1e9, mid + 20})
          extractor.extract(isovalue);
        r.expect_mesh(extractor, last);
      }
      if (has_many_blocks()) {
        EXPECT_GT(extractor.asked(), 8u);
      }
    }
  }
}

TYPED_TEST(GpuStanding, NoiseOfARegion) {
  const double mid = this->lowest() + 100;
  Resident<TypeParam> r(this->noise({97, 66, 75}, 5));
  r.options.roi = {{3, 0, 31}, {96, 64, 75}};
  r.options.normals = true;
  gpu::ResidentExtractor extractor(r.volume, r.options, {.patience = kLong});
  for (int i = 0; i < 5; ++i) {
    extractor.extract(mid - 90);
    extractor.extract(mid + 60);
    extractor.extract(mid + 5);
    r.expect_mesh(extractor, mid + 0.5 * i);
  }
  if (has_many_blocks()) {
    EXPECT_GT(extractor.asked(), 4u);
  }
}

TYPED_TEST(GpuStanding, OneTile) {
  const double mid = this->lowest() + 100;
  Resident<TypeParam> r(this->noise({33, 32, 33}, 2));
  gpu::ResidentExtractor extractor(r.volume, r.options, {.patience = kLong});
  const auto start = std::chrono::steady_clock::now();
  for (int i = 0; i < 10; ++i) extractor.extract(mid + 5 * i);
  const bool in_time = std::chrono::steady_clock::now() - start < kLong;
  if (in_time) {  // not under tools
    EXPECT_EQ(extractor.asked(), 7u) << "two that came soon, and one that stayed";
  }
  r.expect_mesh(extractor, mid);
}

/// 40 tiles of more than there is room for, all of them, and 2 again.
TYPED_TEST(GpuStanding, MoreTilesThanItHasBlocksFor) {
  const Field<TypeParam> field({340, 300, 3}, [](Int3 p) {
    if (p.x % 2 == 0) return 0.0;
    return p.x >= 100 ? 20.0 : p.x >= 60 || p.y >= 30 ? 80.0 : 90.0;
  });
  Resident<TypeParam> r(field);
  gpu::ResidentExtractor extractor(r.volume, r.options, {.patience = kLong});
  for (int i = 0; i < 3; ++i) {
    for (const double isovalue : {85.0, 84.0, 50.0, 51.0, 10.0, 11.0, 70.0, 83.0})
      extractor.extract(isovalue);
    r.expect_mesh(extractor, std::array{86.0, 9.0, 52.0}[static_cast<std::size_t>(i)]);
  }
  if (has_many_blocks()) {
    EXPECT_GT(extractor.asked(), 4u);
  }
}

/// Two that share a stream, measurements, and one that goes while its launch stands by.
TYPED_TEST(GpuStanding, OthersComeBetween) {
  const double mid = this->lowest() + 100;
  Resident<TypeParam> r(this->waves({67, 41, 75}));
  gpu::ResidentExtractor one(r.volume, r.options, {.patience = 2ms}),
      other(r.volume, r.options, {.patience = 2ms});
  for (int i = 0; i < 4; ++i) {
    for (int j = 0; j < 5; ++j) one.extract(mid + j);
    for (int j = 0; j < 5; ++j) other.extract(mid - j);
    one.extract(mid);
    other.repeat();
    EXPECT_GT(other.milliseconds(), 0);
    r.expect_mesh(other, mid + 5 * i);
    r.expect_mesh(one, mid - 5 * i);
    gpu::ResidentExtractor third(r.volume, r.options, {.patience = kLong});
    for (int j = 0; j < 5; ++j) third.extract(mid + 2 * j);
    if (has_many_blocks()) {
      EXPECT_GT(third.asked(), 0u);
    }
  }
}

TYPED_TEST(GpuStanding, NoneWithoutPatience) {
  Resident<TypeParam> r(this->waves({67, 41, 75}));
  gpu::ResidentExtractor extractor(r.volume, r.options, {.patience = 0s});
  for (int i = 0; i < 20; ++i) extractor.extract(this->lowest() + 90 + i);
  EXPECT_EQ(extractor.asked(), 0u);
  r.expect_mesh(extractor, this->lowest() + 100);
}

/// Two by turns, each of which would stay for the next of its own.
TYPED_TEST(GpuStanding, OthersOfTheVolumeNeedNotWait) {
  Resident<TypeParam> r(this->waves({33, 41, 35}));
  gpu::ResidentExtractor one(r.volume, r.options, {.patience = kLong}),
      other(r.volume, r.options, {.patience = kLong});
  const auto seconds_of = [](auto&& f) {
    const auto start = std::chrono::steady_clock::now();
    for (int i = 0; i < 20; ++i) f(i);
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  };
  const double by_one = seconds_of([&](int i) { one.extract(this->lowest() + 90 + i); });
  const double by_turns = seconds_of([&](int i) {
    one.extract(this->lowest() + 90 + i);
    other.extract(this->lowest() + 110 - i);
    for (int j = 0; j < 3; ++j) one.extract(this->lowest() + 90 + j);
    MeshBuffer mesh;
    other.download(mesh);
  });
  EXPECT_LT(by_turns, 10 * by_one + 10 * std::chrono::duration<double>(kLong).count());
  r.expect_mesh(one, this->lowest() + 100);
  r.expect_mesh(other, this->lowest() + 101);
}

/// Not all blocks that would stay fit beside other work, which ends only when these are done: those
/// that do must go.
TYPED_TEST(GpuStanding, BlocksThatStayGoForTheirOthers) {
  Resident<TypeParam> r(this->waves({67, 41, 75}));
  gpu::ResidentExtractor extractor(r.volume, r.options, {.patience = 2ms});
  gpu::ResidentExtractor impatient(r.volume, r.options, {.patience = 0s});
  extractor.extract(this->lowest() + 100);
  impatient.extract(this->lowest() + 100);
  const BusyDevice busy(2);
  impatient.extract(this->lowest() + 100);
  if (busy.has_ended()) GTEST_SKIP() << "kernels run one after the other here";
  for (int i = 0; i < 20; ++i) extractor.extract(this->lowest() + 90 + i);
  EXPECT_FALSE(busy.has_ended());
  r.expect_mesh(extractor, this->lowest() + 100);
}

/// Isovalues come about when the device gives up waiting: some are seen, some are not, and some
/// come to one that has just left.
TEST(GpuStandingFor, IsovaluesThatComeAsTimeIsUp) {
  if (!gpu::device_available()) GTEST_SKIP() << "no CUDA device";
  using Clock = std::chrono::steady_clock;
  Resident<std::uint8_t> r(Field<std::uint8_t>({32, 31, 32}, [](Int3 p) {  // a tile
    return 127 + 90 * std::sin(0.2 * static_cast<double>(p.x)) *
                     std::cos(0.17 * static_cast<double>(p.y + p.z));
  }));
  gpu::ResidentExtractor extractor(r.volume, r.options, {.patience = 20us});
  const gpu::DeviceCounts expected[2] = {extractor.extract(120), extractor.extract(150.5)};
  std::minstd_rand random(1);
  constexpr int kTimes = 20'000;
  for (int i = 0; i < kTimes; ++i) {
    if (i % 1000 == 999) r.expect_mesh(extractor, 90 + i % 53);
    const auto until = Clock::now() + std::chrono::nanoseconds(random() % 25'000);
    while (Clock::now() < until) {
    }
    const gpu::DeviceCounts counts = extractor.extract(i % 2 ? 150.5 : 120);
    ASSERT_EQ(counts.vertices, expected[i % 2].vertices) << i;
    ASSERT_EQ(counts.triangles, expected[i % 2].triangles) << i;
  }
  const auto start = Clock::now();
  extractor.extract(120);
  if (Clock::now() - start > 1ms) return;  // under a tool all come too late
  EXPECT_GT(extractor.asked(), 10u);
  EXPECT_LT(extractor.asked(), kTimes - 10u);
}

}  // namespace
}  // namespace isobrick::testing
