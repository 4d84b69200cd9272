#include <gtest/gtest.h>

#include <chrono>
#include <random>
#include <thread>

#include "isobrick/gpu/device_volume.h"
#include "tests/gpu/compare.h"

// Extractions that stay on the device for the next isovalue make what others make.

namespace isobrick::testing {
namespace {

using namespace std::chrono_literals;

/// A volume on the device, and what an extractor of it should make.
template <class T>
struct Resident {
  Field<T> field;
  Lattice lattice;
  DenseBricks bricks;
  gpu::DeviceVolume volume;
  SurfaceOptions options;

  explicit Resident(Field<T> f)
      : field(std::move(f)),
        lattice{field.extent, {64, 64, 64}, scalar_type_of<T>},
        bricks(lattice, field.samples.data()),
        volume(lattice, bricks, 0) {
    options.roi = lattice.box();
  }

  void expect_mesh(gpu::ResidentExtractor& extractor, double isovalue) {
    SCOPED_TRACE("isovalue " + std::to_string(isovalue));
    options.isovalue = isovalue;
    const MeshBuffer expected = on_cpu(field, lattice, bricks, options);
    const gpu::DeviceCounts counts = extractor.extract(isovalue);
    EXPECT_EQ(counts.vertices, expected.positions.size());
    EXPECT_EQ(counts.triangles, expected.triangles.size());
    MeshBuffer mesh;
    extractor.download(mesh);
    expect_same(expected, mesh);
  }
};

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
      gpu::ResidentExtractor extractor(r.volume, r.options, {.search = search, .patience = 10s});
      // A mesh is looked at after others have been made by the same launch; some need more room
      // than there is, and there is nothing at one.
      for (const double last : {mid - 60, mid, mid + 0.5, mid + 35}) {
        for (const double isovalue : {mid + 75, mid - 20.5, mid + 3, 1e9, mid + 20})
          extractor.extract(isovalue);
        r.expect_mesh(extractor, last);
      }
      EXPECT_GT(extractor.asked(), 8u);
    }
  }
}

TYPED_TEST(GpuStanding, NoiseOfARegion) {
  const double mid = this->lowest() + 100;
  Resident<TypeParam> r(this->noise({97, 66, 75}, 5));
  r.options.roi = {{3, 0, 31}, {96, 64, 75}};
  r.options.normals = true;
  gpu::ResidentExtractor extractor(r.volume, r.options, {.patience = 10s});
  for (int i = 0; i < 5; ++i) {
    extractor.extract(mid - 90);
    extractor.extract(mid + 60);
    extractor.extract(mid + 5);
    r.expect_mesh(extractor, mid + 0.5 * i);
  }
  EXPECT_GT(extractor.asked(), 4u);
}

/// 33 of more tiles than have slabs, all of them, and 2 again.
TYPED_TEST(GpuStanding, MoreTilesThanItHasBlocksFor) {
  const Field<TypeParam> field({340, 300, 3}, [](Int3 p) {
    if (p.x % 2 == 0) return 0.0;
    return p.x >= 100 ? 20.0 : p.x >= 60 || p.y >= 30 ? 80.0 : 90.0;
  });
  Resident<TypeParam> r(field);
  gpu::ResidentExtractor extractor(r.volume, r.options, {.patience = 10s});
  for (int i = 0; i < 3; ++i) {
    for (const double isovalue : {85.0, 84.0, 50.0, 51.0, 10.0, 11.0, 70.0, 83.0})
      extractor.extract(isovalue);
    r.expect_mesh(extractor, std::array{86.0, 9.0, 52.0}[static_cast<std::size_t>(i)]);
  }
  EXPECT_GT(extractor.asked(), 4u);
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
    gpu::ResidentExtractor third(r.volume, r.options, {.patience = 10s});
    for (int j = 0; j < 5; ++j) third.extract(mid + 2 * j);
    EXPECT_GT(third.asked(), 0u);
  }
}

TYPED_TEST(GpuStanding, NoneWithoutPatience) {
  Resident<TypeParam> r(this->waves({67, 41, 75}));
  gpu::ResidentExtractor extractor(r.volume, r.options, {.patience = 0s});
  for (int i = 0; i < 20; ++i) extractor.extract(this->lowest() + 90 + i);
  EXPECT_EQ(extractor.asked(), 0u);
  r.expect_mesh(extractor, this->lowest() + 100);
}

/// Isovalues come about when the device gives up waiting: some are seen, some are not, and some
/// come to one that has just left.
TEST(GpuStandingFor, IsovaluesThatComeAsTimeIsUp) {
  if (!gpu::device_available()) GTEST_SKIP() << "no CUDA device";
  Resident<std::uint8_t> r(Field<std::uint8_t>({67, 41, 75}, [](Int3 p) {
    return 127 + 90 * std::sin(0.2 * static_cast<double>(p.x)) *
                     std::cos(0.17 * static_cast<double>(p.y + p.z));
  }));
  gpu::ResidentExtractor extractor(r.volume, r.options, {.patience = 20us});
  const gpu::DeviceCounts expected[2] = {extractor.extract(120), extractor.extract(150.5)};
  std::minstd_rand random(1);
  for (int i = 0; i < 20'000; ++i) {
    const auto until =
        std::chrono::steady_clock::now() + std::chrono::nanoseconds(random() % 25'000);
    while (std::chrono::steady_clock::now() < until) {
    }
    const gpu::DeviceCounts counts = extractor.extract(i % 2 ? 150.5 : 120);
    ASSERT_EQ(counts.vertices, expected[i % 2].vertices) << i;
    ASSERT_EQ(counts.triangles, expected[i % 2].triangles) << i;
  }
  RecordProperty("asked", std::to_string(extractor.asked()));
  r.expect_mesh(extractor, 120);
}

}  // namespace
}  // namespace isobrick::testing
