#include <cuda_runtime_api.h>
#include <gtest/gtest.h>

#include <atomic>

#include <isobrick/device_volume.h>
#include <isobrick/error.h>
#include "gpu/memory/device_buffer.h"
#include "gpu/resident/cached_extractor.h"
#include "tests/gpu/resident.h"
#include "tests/gpu/strided_samples.h"

// Meshes of arrays in device memory are those of the CPU, byte for byte.

namespace isobrick::testing {
namespace {

using gpu::CachedExtractor;
using gpu::check;

constexpr std::uint64_t kAnyMemory = ~std::uint64_t{0};

/// An array in device memory.
template <class T>
struct ArrayOnDevice {
  StridedSamples<T> samples;
  gpu::DeviceBuffer<T> memory;
  DeviceArray array;

  ArrayOnDevice(const Field<T>& field, const SampleLayout& layout = kSampleLayouts[0])
      : samples(field, layout), memory(samples.memory.size()) {
    check(cudaMemcpy(memory.data(), samples.memory.data(), memory.bytes(), cudaMemcpyHostToDevice));
    array = DeviceArray::of(memory.data() + samples.first, field.extent);
    array.strides = samples.strides;
  }
};

SurfaceOptions surface(double isovalue, Int3 extent, bool normals = false) {
  SurfaceOptions options;
  options.isovalue = isovalue;
  options.roi = {{0, 0, 0}, extent};
  options.normals = normals;
  return options;
}

DeviceMesh extract(CachedExtractor& extractor, const SurfaceOptions& options,
                   std::uint64_t max_bytes = kAnyMemory) {
  return extractor.finish(extractor.begin(options, max_bytes));
}

template <class T>
isobrick::Mesh expected_mesh(const Field<T>& field, SurfaceOptions options) {
  const Lattice lattice{field.extent, {64, 64, 64}, scalar_type_of<T>};
  options.may_have_nan = std::is_floating_point_v<T>;
  return on_cpu(field, lattice, DenseBricks(lattice, field.samples.data()), options);
}

template <class T>
class GpuArray : public DeviceTest<T> {};

TYPED_TEST_SUITE(GpuArray, DeviceTypes);

TYPED_TEST(GpuArray, OfAnyLayoutIsTheMeshOfTheCpu) {
  const double mid = this->lowest() + 100;
  const auto field = this->noise({67, 41, 75}, 1);
  for (const SampleLayout& layout : kSampleLayouts) {
    SCOPED_TRACE(layout.name);
    const ArrayOnDevice<TypeParam> on_device(field, layout);
    CachedExtractor extractor(on_device.array);
    for (const bool normals : {false, true})
      for (const double isovalue : {mid, mid + 0.5, mid - 90}) {
        const SurfaceOptions options = surface(isovalue, field.extent, normals);
        expect_same(expected_mesh(field, options), extract(extractor, options).download());
      }
  }
}

TYPED_TEST(GpuArray, DegenerateTrianglesAreLeftOut) {
  const auto field = this->coarse({67, 41, 75}, 1);
  const ArrayOnDevice<TypeParam> on_device(field, kSampleLayouts[2]);
  CachedExtractor extractor(on_device.array);
  for (const bool drop : {false, true, false})
    for (const double above : {0.0, 0.5}) {
      SurfaceOptions options = surface(this->lowest() + 100 + above, field.extent, true);
      options.drop_degenerate = drop;
      expect_same(expected_mesh(field, options), extract(extractor, options).download());
    }
}

TYPED_TEST(GpuArray, TheBorderIsCapped) {
  const auto field = this->coarse({67, 41, 75}, 1);
  const ArrayOnDevice<TypeParam> on_device(field, kSampleLayouts[2]);
  CachedExtractor extractor(on_device.array);
  for (const bool cap : {false, true, false})
    for (const Inside inside : {Inside::above, Inside::below})
      for (const double above : {0.0, 0.5, 1000.0}) {
        SurfaceOptions options = surface(this->lowest() + 100 + above, field.extent, true);
        options.cap = cap;
        options.inside = inside;
        expect_same(expected_mesh(field, options), extract(extractor, options).download());
      }
}

TYPED_TEST(GpuArray, BothTopologiesInTurn) {
  const auto field = this->noise({67, 41, 75}, 1);
  const ArrayOnDevice<TypeParam> on_device(field, kSampleLayouts[2]);
  CachedExtractor extractor(on_device.array);
  for (const Topology topology :
       {Topology::consistent, Topology::trilinear, Topology::consistent}) {
    SurfaceOptions options = surface(this->lowest() + 100, field.extent, true);
    options.topology = topology;
    expect_same(expected_mesh(field, options), extract(extractor, options).download());
  }
}

TYPED_TEST(GpuArray, OfAnyExtentIsTheMeshOfTheCpu) {
  for (const Int3 extent : {Int3{1, 1, 1}, Int3{2, 2, 2}, Int3{32, 33, 64}, Int3{131, 70, 97}}) {
    const auto field = this->waves(extent);
    const ArrayOnDevice<TypeParam> on_device(field);
    CachedExtractor extractor(on_device.array);
    const SurfaceOptions options = surface(this->lowest() + 100.5, extent, true);
    expect_same(expected_mesh(field, options), extract(extractor, options).download());
  }
}

class GpuArrayOf : public DeviceTest<float> {};

TEST_F(GpuArrayOf, NaNIsTheMeshOfTheCpu) {
  const auto field = with_nan(noise({67, 41, 75}, 2), 3, 20);
  const ArrayOnDevice<float> on_device(field, kSampleLayouts[4]);
  CachedExtractor extractor(on_device.array);
  const SurfaceOptions options = surface(0, field.extent, true);
  expect_same(expected_mesh(field, options), extract(extractor, options).download());
}

/// Samples that are written in a stream of the caller's, just before.
TEST_F(GpuArrayOf, AStreamOfTheCallersOrdersAll) {
  const auto field = waves({131, 70, 97});
  const SurfaceOptions options = surface(0, field.extent);
  gpu::Stream stream;
  const ArrayOnDevice<float> from(field);
  const gpu::DeviceBuffer<float> to(from.memory.size());
  check(cudaMemset(to.data(), 0, to.bytes()));
  check(cudaMemcpyAsync(to.data(), from.memory.data(), to.bytes(), cudaMemcpyDeviceToDevice,
                        stream.get()));
  DeviceArray array = DeviceArray::of(static_cast<const float*>(to.data()), field.extent);
  array.strides = from.array.strides;
  array.stream = stream.get();
  CachedExtractor extractor(array);
  const DeviceMesh mesh = extract(extractor, options);
  EXPECT_EQ(mesh.stream(), stream.get());
  gpu::Stream other;
  mesh.precede(other.get());
  std::vector<Vec3f> positions(mesh.positions().size());
  check(cudaMemcpyAsync(positions.data(), mesh.positions().data(), mesh.positions().size_bytes(),
                        cudaMemcpyDeviceToHost, other.get()));
  other.wait();
  const isobrick::Mesh expected = expected_mesh(field, options);
  ASSERT_EQ(positions.size(), expected.positions.size());
  EXPECT_EQ(
      std::memcmp(positions.data(), expected.positions.data(), positions.size() * sizeof(Vec3f)),
      0);
  expect_same(expected, mesh.download());
}

/// Counts what it gives.
class CountingMemory final : public DeviceMemory {
 public:
  std::atomic<std::int64_t> held = 0, most = 0, calls = 0;

  void* allocate(std::size_t bytes, CUstream_st* stream) override {
    void* memory = nullptr;
    check(cudaMallocAsync(&memory, bytes, stream));
    held += static_cast<std::int64_t>(bytes);
    most = std::max<std::int64_t>(most, held);
    ++calls;
    return memory;
  }
  void free(void* memory, std::size_t bytes, CUstream_st* stream) noexcept override {
    held -= static_cast<std::int64_t>(bytes);
    (void)cudaFreeAsync(memory, stream);
  }
};

TEST_F(GpuArrayOf, MemoryOfTheCallersIsAllThatIsTaken) {
  const auto field = waves({131, 70, 97});
  const ArrayOnDevice<float> on_device(field);
  const auto memory = std::make_shared<CountingMemory>();
  DeviceArray array = on_device.array;
  array.memory = memory;
  DeviceMesh mesh;
  {
    CachedExtractor extractor(array);
    EXPECT_GT(memory->held, 0);
    mesh = extract(extractor, surface(0, field.extent));
    // Later meshes take their memory once.
    const DeviceMesh second = extract(extractor, surface(5, field.extent));
    const std::int64_t calls = memory->calls;
    const DeviceMesh third = extract(extractor, surface(5, field.extent));
    EXPECT_EQ(memory->calls, calls + 2);
  }
  expect_same(expected_mesh(field, surface(0, field.extent)), mesh.download());
  EXPECT_GE(memory->held, static_cast<std::int64_t>(mesh.positions().size_bytes() +
                                                    mesh.triangles().size_bytes()));
  mesh = {};
  EXPECT_EQ(memory->held, 0);
}

/// A ball of 20 samples in a corner of 320³: what is held is no matter of the volume.
TEST_F(GpuArrayOf, MemoryIsThatOfWhatTheSurfaceTouches) {
  const Field<std::uint16_t> field({320, 320, 320}, [](Int3 p) {
    const auto d = [](Index v) { return static_cast<double>(v - 50); };
    return std::max(0.0, 1000 - 50 * std::hypot(d(p.x), d(p.y), d(p.z)));
  });
  const ArrayOnDevice<std::uint16_t> on_device(field);
  const auto memory = std::make_shared<CountingMemory>();
  DeviceArray array = on_device.array;
  array.memory = memory;
  CachedExtractor extractor(array);
  const SurfaceOptions options = surface(500, field.extent, true);
  const DeviceMesh mesh = extract(extractor, options, 30 << 20);
  EXPECT_LT(memory->most, 30 << 20);
  EXPECT_GT(field.samples.size() * 2, std::size_t{60} << 20);
  expect_same(expected_mesh(field, options), mesh.download());
}

/// Isovalues that together touch more tiles than any of them: those of before are forgotten.
TEST_F(GpuArrayOf, ManyIsovaluesOneAfterTheOther) {
  const Field<float> field({200, 210, 190}, [](Int3 p) {
    return static_cast<double>(p.x) + 3 * std::sin(static_cast<double>(p.y + 2 * p.z) * 0.1);
  });
  const ArrayOnDevice<float> on_device(field);
  CachedExtractor extractor(on_device.array);
  for (const double isovalue : {10.0, 60.0, 100.0, 150.0, 190.0, 15.0, 100.0})
    for (const bool normals : {false, true}) {
      const SurfaceOptions options = surface(isovalue, field.extent, normals);
      expect_same(expected_mesh(field, options), extract(extractor, options).download());
    }
}

TEST_F(GpuArrayOf, PendingMeshes) {
  const auto field = waves({131, 70, 97});
  const ArrayOnDevice<float> on_device(field);
  CachedExtractor extractor(on_device.array);
  const SurfaceOptions first = surface(0, field.extent), second = surface(20, field.extent);
  const std::uint64_t superseded = extractor.begin(first, kAnyMemory);
  const std::uint64_t number = extractor.begin(second, kAnyMemory);
  EXPECT_TRUE(extractor.is_over(superseded));
  EXPECT_THROW(extractor.finish(superseded), UsageError);
  while (!extractor.is_over(number)) {
  }
  expect_same(expected_mesh(field, second), extractor.finish(number).download());
  EXPECT_THROW(extractor.finish(number), UsageError);
}

TEST_F(GpuArrayOf, MeshesOutliveTheirExtractorAndOneAnother) {
  const auto field = waves({131, 70, 97});
  std::vector<DeviceMesh> meshes;
  {
    const ArrayOnDevice<float> on_device(field);
    CachedExtractor extractor(on_device.array);
    for (const double isovalue : {0.0, 30.0, -20.0, 1e9})
      meshes.push_back(extract(extractor, surface(isovalue, field.extent)));
  }
  EXPECT_EQ(meshes[3].device(), -1);
  EXPECT_EQ(meshes[3].download().triangles.size(), 0u);
  expect_same(expected_mesh(field, surface(30, field.extent)), meshes[1].download());
  expect_same(expected_mesh(field, surface(0, field.extent)), meshes[0].download());
}

TEST_F(GpuArrayOf, WhatMakesNoSenseIsRefused) {
  const auto field = waves({40, 40, 40});
  EXPECT_THROW(CachedExtractor(DeviceArray::of(field.samples.data(), field.extent)), UsageError);
  const ArrayOnDevice<float> on_device(field);
  CachedExtractor extractor(on_device.array);
  EXPECT_THROW(extract(extractor, surface(std::nan(""), field.extent)), UsageError);
  EXPECT_THROW(extract(extractor, surface(0, field.extent), 1 << 4), UsageError);
  EXPECT_THROW(extract(extractor, surface(0, field.extent), 1 << 16), gpu::OutOfDeviceMemory);
  expect_same(expected_mesh(field, surface(0, field.extent)),
              extract(extractor, surface(0, field.extent)).download());
}

}  // namespace
}  // namespace isobrick::testing
