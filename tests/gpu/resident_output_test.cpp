#include <gtest/gtest.h>

#include <memory>
#include <thread>
#include <vector>

#include <isobrick/error.h>
#include "surface/surface_extractor.h"
#include "tests/gpu/collecting_sink.h"
#include "tests/gpu/resident.h"

// How the mesh of a resident volume leaves the device, and what bounds it there.

namespace isobrick::testing {
namespace {

template <class T>
class GpuResidentOutput : public DeviceTest<T> {};

TYPED_TEST_SUITE(GpuResidentOutput, DeviceTypes);

TYPED_TEST(GpuResidentOutput, ASinkGetsTheMeshInChunks) {
  Resident<TypeParam> r(this->waves({131, 70, 97}));
  for (const bool normals : {false, true}) {
    r.options.normals = normals;
    gpu::ResidentExtractor extractor(r.volume, r.options);
    for (const std::size_t chunk_bytes :
         {std::size_t{4096}, std::size_t{100000}, std::size_t{1} << 24})
      for (const double shift : {0.5, 70.0, 1e6}) {
        r.options.isovalue = this->lowest() + 100 + shift;
        const isobrick::Mesh expected = on_cpu(r.field, r.lattice, r.bricks, r.options);
        extractor.extract(r.options.isovalue);
        CollectingSink sink;
        extractor.write(sink, chunk_bytes);
        expect_same(expected, sink.mesh);
        EXPECT_LE(sink.max_chunk, chunk_bytes);
        const SurfaceReport report = extractor.report();
        EXPECT_EQ(report.vertices, expected.positions.size());
        EXPECT_EQ(report.triangles, expected.triangles.size());
        EXPECT_EQ(report.sink.bytes, mesh_bytes({report.vertices, report.triangles}, normals));
        EXPECT_EQ(report.pinned_bytes, 2 * chunk_bytes);
        EXPECT_EQ(report.device_bytes, extractor.bytes());
      }
    extractor.extract(this->lowest() + 100.5);
    FailingSink broken(4);
    EXPECT_THROW(extractor.write(broken, 4096), Error);
    EXPECT_EQ(broken.taken, 4);
  }
}

TYPED_TEST(GpuResidentOutput, MeshesAreWrittenAtTheSameTime) {
  Resident<TypeParam> r(this->waves({131, 70, 97}));
  std::vector<std::unique_ptr<gpu::ResidentExtractor>> extractors;
  std::vector<isobrick::Mesh> expected;
  for (const double shift : {0.5, 30.0, 70.0}) {
    r.options.isovalue = this->lowest() + 100 + shift;
    expected.push_back(on_cpu(r.field, r.lattice, r.bricks, r.options));
    extractors.push_back(std::make_unique<gpu::ResidentExtractor>(r.volume, r.options));
    extractors.back()->extract(r.options.isovalue);
    EXPECT_THROW(extractors.back()->reserve_chunks(23), UsageError);
  }
  std::vector<CollectingSink> sinks(3);
  std::vector<std::thread> threads;
  for (std::size_t i = 0; i < 3; ++i)
    threads.emplace_back([&, i] { extractors[i]->write(sinks[i], 4096); });
  for (std::thread& thread : threads) thread.join();
  for (std::size_t i = 0; i < 3; ++i) expect_same(expected[i], sinks[i].mesh);
}

TYPED_TEST(GpuResidentOutput, AMeshThatDoesNotFitTheBoundIsRefusedAndOthersAreMade) {
  Resident<TypeParam> r(this->noise({67, 41, 75}, 1));
  const double mid = this->lowest() + 100, high = mid + 95;
  for (const bool normals : {false, true}) {
    r.options.normals = normals;
    const std::uint64_t empty = gpu::ResidentExtractor(r.volume, r.options).bytes();
    gpu::ResidentExtractor usual(r.volume, r.options);
    const gpu::DeviceCounts large = usual.extract(mid), small = usual.extract(high);
    const auto bound = [&](const gpu::DeviceCounts& counts) {
      return empty + mesh_bytes({counts.vertices, counts.triangles}, normals);
    };
    ASSERT_LT(2 * small.triangles, large.triangles);
    gpu::ResidentExtractor tight(r.volume, r.options, {}, bound(large));
    for (const double isovalue : {high, mid, high}) r.expect_mesh(tight, isovalue);
    EXPECT_LE(tight.bytes(), bound(large));
    gpu::ResidentExtractor tighter(r.volume, r.options, {}, bound(large) - 1);
    r.expect_mesh(tighter, high);
    EXPECT_THROW(tighter.extract(mid), gpu::OutOfDeviceMemory);
    isobrick::Mesh none;
    tighter.download(none);
    EXPECT_EQ(none.positions.size(), 0u) << "a mesh that was not made";
    r.expect_mesh(tighter, high);
    EXPECT_LT(tighter.bytes(), bound(large));
  }
}

}  // namespace
}  // namespace isobrick::testing
