#include <isobrick/volume_extractor.h>

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <functional>
#include <stdexcept>
#include <stop_token>
#include <string_view>

#include <isobrick/error.h>
#include <isobrick/mesh_sinks.h>
#include "tests/pipeline/convert_store.h"
#include "tests/surface/field.h"

namespace isobrick::inline v0 {
namespace {

using testing::Field;

template <class T>
Volume volume_of(const Field<T>& field) {
  return Volume::of(field.samples.data(), field.extent);
}

/// A function that copies the samples of a box of a field, which must outlive it.
template <class T>
std::function<void(Box3, void*)> reader_of(const Field<T>& field) {
  return [&field](Box3 box, void* out) {
    auto* to = static_cast<T*>(out);
    for_each_point(box, [&](Int3 p) { *to++ = field.at(p); });
  };
}

bool same(const Mesh& mesh, const testing::Mesh& expected) {
  const auto equal = [](const auto& a, const auto& b) {
    return a.size() == b.size() &&
           (a.size() == 0 || std::memcmp(a.data(), b.data(), a.size() * sizeof(a[0])) == 0);
  };
  return equal(mesh.positions, expected.positions) && equal(mesh.normals, expected.normals) &&
         equal(mesh.triangles, expected.triangles);
}

/// The mesh through bricks, which the tests of the extractor compare with plain marching cubes.
template <class T>
testing::Mesh expected_mesh(const Field<T>& field, const ExtractOptions& options) {
  return testing::extract(field, {.isovalue = options.isovalue,
                                  .inside = options.inside.value_or(Inside::above),
                                  .normals = options.normals,
                                  .roi = options.roi,
                                  .drop_degenerate = options.drop_degenerate,
                                  .topology = options.topology});
}

template <class T>
Field<T> noise_with_calm(Int3 extent) {
  auto field = testing::padded_noise<T>(extent, 0, 100, T{0}, 11);
  for_each_point({{0, 0, 0}, {extent.x / 2, extent.y, extent.z}},
                 [&](Int3 p) { field.at(p) = static_cast<T>(p.z < extent.z / 2 ? 0 : 90); });
  return field;
}

/// Samples of a field at other strides, with what lies between them.
template <class T>
struct Strided {
  std::vector<std::byte> bytes;
  Volume volume;

  /// `order` lists the axes from the nearest samples to the farthest, `gap` bytes lie between two
  /// samples of that first axis, and axes of `backwards` run towards lower addresses.
  Strided(const Field<T>& field, std::array<int, 3> order, Index gap, std::array<bool, 3> backwards,
          std::size_t shift = 0) {
    const Int3 n = field.extent;
    Int3 strides;
    Index step = static_cast<Index>(sizeof(T)) + gap;
    for (const int axis : order) {
      strides[axis] = step;
      step *= n[axis];
    }
    bytes.assign(static_cast<std::size_t>(step) + shift, std::byte{0x5a});
    Index first = static_cast<Index>(shift);
    for (int axis = 0; axis < 3; ++axis)
      if (backwards[static_cast<std::size_t>(axis)]) {
        first += strides[axis] * (n[axis] - 1);
        strides[axis] = -strides[axis];
      }
    for_each_point(field.box(), [&](Int3 p) {
      std::memcpy(bytes.data() + first + dot(p, strides), &field.at(p), sizeof(T));
    });
    volume.samples = bytes.data() + first;
    volume.type = scalar_type_of<T>;
    volume.extent = n;
    volume.strides = strides;
  }
};

template <class T>
class VolumeOf : public ::testing::Test {};
using Types = ::testing::Types<std::uint8_t, std::int8_t, std::uint16_t, std::int16_t,
                               std::uint32_t, std::int32_t, float, double>;
TYPED_TEST_SUITE(VolumeOf, Types);

TYPED_TEST(VolumeOf, StridesNeverShow) {
  const auto field = noise_with_calm<TypeParam>({75, 50, 67});
  for (const bool normals : {false, true}) {
    const ExtractOptions options{.isovalue = 42, .normals = normals};
    const testing::Mesh expected = expected_mesh(field, options);
    ASSERT_GT(expected.triangles.size(), 10000u);
    EXPECT_TRUE(same(extract(volume_of(field), options), expected));
    for (const std::array<int, 3> order :
         {std::array{0, 1, 2}, std::array{2, 1, 0}, std::array{1, 0, 2}, std::array{2, 0, 1}})
      for (const Index gap : {Index{0}, static_cast<Index>(sizeof(TypeParam)), Index{3}})
        for (const std::array<bool, 3> backwards :
             {std::array{false, false, false}, std::array{true, false, false},
              std::array{false, true, true}}) {
          const Strided<TypeParam> strided(field, order, gap, backwards, gap == 3 ? 1 : 0);
          EXPECT_TRUE(same(extract(strided.volume, options), expected))
              << "axes " << order[0] << order[1] << order[2] << " gap " << gap << " backwards "
              << backwards[0] << backwards[1];
        }
  }
}

TYPED_TEST(VolumeOf, FunctionGivesTheSameMesh) {
  const auto field = noise_with_calm<TypeParam>({150, 137, 70});
  const Box3 roi{{3, 40, 1}, {149, 130, 66}};
  for (const bool concurrent : {false, true})
    for (const std::optional<Box3> part : {std::optional<Box3>(), std::optional(roi)}) {
      const ExtractOptions options{.isovalue = 42, .roi = part, .normals = true};
      const testing::Mesh expected = expected_mesh(field, options);
      Volume volume = volume_of(field);
      volume.samples = nullptr;
      volume.concurrent_reads = concurrent;
      volume.read = reader_of(field);
      EXPECT_TRUE(same(extract(volume, options), expected));
      // One region at a time, and the ranges of the first extraction.
      VolumeExtractor extractor(volume);
      Mesh mesh;
      ExtractOptions small = options;
      small.memory = std::uint64_t{9} << 20;
      small.threads = 1;
      for (int time = 0; time < 2; ++time) {
        extractor.extract(small, mesh);
        EXPECT_TRUE(same(mesh, expected)) << time;
      }
    }
}

TYPED_TEST(VolumeOf, MissingSamplesAreNaN) {
  const auto field = noise_with_calm<TypeParam>({60, 51, 45});
  std::vector<std::uint8_t> mask(field.samples.size(), 1);
  std::mt19937 random(3);
  for (std::uint8_t& present : mask) present = random() % 50 != 0;
  using Wide = std::conditional_t<type_with_nan(scalar_type_of<TypeParam>) == ScalarType::f64,
                                  double, float>;
  Field<Wide> holes(field.extent);
  for (std::size_t i = 0; i < mask.size(); ++i)
    holes.samples[i] = mask[i] && field.samples[i] != TypeParam{57}
                           ? static_cast<Wide>(field.samples[i])
                           : std::numeric_limits<Wide>::quiet_NaN();
  const ExtractOptions options{.isovalue = 42, .normals = true};
  const testing::Mesh expected = expected_mesh(holes, options);
  ASSERT_GT(expected.triangles.size(), 1000u);
  Volume volume = volume_of(field);
  volume.nodata = 57;
  volume.mask = mask.data();
  EXPECT_TRUE(same(extract(volume, options), expected));
  Volume read = volume;
  read.samples = nullptr;
  read.read = reader_of(field);
  EXPECT_TRUE(same(extract(read, options), expected));
}

/// Keeps what is known before the first chunk.
class HeaderSink final : public MeshSink {
 public:
  Indexing indexing() const override { return Indexing::welded; }
  void begin(const MeshHeader& header) override { header_ = header; }
  void write(const MeshChunk&) override {}
  void finish() override {}
  std::uint64_t bytes() const override { return 0; }
  MeshHeader header_;
};

// Of samples and of the mask: gaps, any order of the axes, and both directions.
TYPED_TEST(VolumeOf, StridesOfMissingSamplesNeverShow) {
  const auto field = noise_with_calm<TypeParam>({60, 51, 45});
  Field<std::uint8_t> mask(field.extent);
  std::mt19937 random(3);
  for (std::uint8_t& present : mask.samples) present = random() % 50 != 0;
  Volume dense = volume_of(field);
  dense.nodata = 57;
  dense.mask = mask.samples.data();
  const ExtractOptions options{.isovalue = 42, .normals = true};
  const Mesh mesh = extract(dense, options);
  ASSERT_GT(mesh.triangles.size(), 1000u);
  const testing::Mesh expected{{mesh.positions.begin(), mesh.positions.end()},
                               {mesh.normals.begin(), mesh.normals.end()},
                               {mesh.triangles.begin(), mesh.triangles.end()},
                               0};
  const Strided<TypeParam> samples(field, {1, 2, 0}, 3, {true, false, true}, 1);
  for (const Index gap : {0, 5})
    for (const std::array<int, 3> order : {std::array{0, 1, 2}, std::array{2, 0, 1}}) {
      const Strided<std::uint8_t> flags(mask, order, gap, {false, true, true});
      Volume volume = samples.volume;
      volume.nodata = 57;
      volume.mask = static_cast<const std::uint8_t*>(flags.volume.samples);
      volume.mask_strides = flags.volume.strides;
      EXPECT_TRUE(same(extract(volume, options), expected)) << gap << " axis " << order[0];
    }
}

// No cell, so no surface; the samples count all the same.
TYPED_TEST(VolumeOf, OneSampleAlongAnAxisIsNoSurface) {
  for (const Int3 extent : {Int3{1, 1, 1}, Int3{100, 100, 1}, Int3{70, 1, 33}, Int3{1, 40, 50}}) {
    Field<TypeParam> field(extent);
    for_each_point(field.box(), [&](Int3 p) { field.at(p) = static_cast<TypeParam>(3 + p.y % 5); });
    field.samples.back() = TypeParam{90};
    Volume by_function = volume_of(field);
    by_function.samples = nullptr;
    by_function.read = reader_of(field);
    // The stride along an axis of one sample says nothing.
    Volume strange = volume_of(field);
    strange.strides = {sizeof(TypeParam), static_cast<Index>(sizeof(TypeParam)) * extent.x,
                       static_cast<Index>(sizeof(TypeParam)) * extent.x * extent.y};
    for (int axis = 0; axis < 3; ++axis)
      if (extent[axis] == 1) strange.strides[axis] = 0;
    for (const Volume& volume : {volume_of(field), by_function, strange}) {
      VolumeExtractor extractor(volume);
      Mesh mesh;
      extractor.extract({.isovalue = 4.5, .normals = true}, mesh);
      EXPECT_TRUE(mesh.positions.empty() && mesh.triangles.empty());
      const double lowest = *std::min_element(field.samples.begin(), field.samples.end());
      EXPECT_EQ(extractor.range(), (ValueRange<double>{lowest, 90})) << extent.x;
    }
  }
}

TEST(VolumeExtractor, ThinVolumesGiveWhatAStoreGives) {
  for (const Int3 extent : {Int3{100, 1, 40}, Int3{97, 65, 2}}) {
    const auto field = testing::padded_noise<float>(extent, 0, 100, NAN, 4);
    test::MemorySource source(extent, ScalarType::f32, test::as_bytes(field.samples));
    const test::TemporaryFolder folder;
    test::convert_quietly(source, folder / "s.zarr", {});
    const StoreReader store(folder / "s.zarr");
    const ExtractOptions options{.isovalue = 42};
    HeaderSink of_store, of_volume;
    extract(store, options, of_store);
    extract(volume_of(field), options, of_volume);
    EXPECT_EQ(of_store.header_.surface.has_value(), of_volume.header_.surface.has_value());
    const Mesh expected = extract(store, options), mesh = extract(volume_of(field), options);
    ASSERT_EQ(mesh.positions.size(), expected.positions.size());
    ASSERT_EQ(mesh.triangles.size(), expected.triangles.size());
    EXPECT_TRUE(
        std::equal(mesh.positions.begin(), mesh.positions.end(), expected.positions.begin()));
  }
}

TEST(VolumeExtractor, TheRangeIsThatOfAllSamples) {
  auto field = testing::padded_noise<float>({83, 65, 49}, -50, 50, 0.0f, 8);
  field.at({82, 64, 48}) = 200;
  field.at({0, 64, 0}) = -300;
  field.at({40, 30, 20}) = NAN;
  const Strided<float> gaps(field, {2, 0, 1}, 3, {false, true, false}, 1);
  Volume by_function = volume_of(field), masked = volume_of(field), none = volume_of(field);
  by_function.samples = nullptr;
  by_function.read = reader_of(field);
  std::vector<std::uint8_t> mask(field.samples.size(), 1);
  masked.mask = mask.data();
  const auto range_of = [](const Volume& volume) {
    VolumeExtractor extractor(volume);
    EXPECT_FALSE(extractor.range());
    Mesh mesh;
    extractor.extract({.isovalue = 42}, mesh);
    return extractor.range();
  };
  const ValueRange<double> expected{-300, 200};
  for (const Volume& volume : {volume_of(field), gaps.volume, by_function, masked})
    EXPECT_EQ(range_of(volume), expected);
  const std::vector<std::uint8_t> nothing(field.samples.size(), 0);
  none.mask = nothing.data();
  EXPECT_FALSE(range_of(none));
}

// What the first extraction has found of NaN holds for the second.
TEST(VolumeExtractor, LaterExtractionsByFunctionKnowOfNaN) {
  auto field = noise_with_calm<float>({75, 50, 67});
  std::mt19937 random(2);
  for (float& sample : field.samples)
    if (random() % 100 == 0) sample = NAN;
  Volume volume = volume_of(field);
  volume.samples = nullptr;
  volume.read = reader_of(field);
  VolumeExtractor extractor(volume);
  Mesh mesh;
  for (const double isovalue : {42.0, 17.5, 42.0}) {
    const ExtractOptions options{.isovalue = isovalue, .normals = true};
    extractor.extract(options, mesh);
    EXPECT_TRUE(same(mesh, expected_mesh(field, options))) << isovalue;
  }
}

// -0.1 is no float: the nearest one is meant.
TEST(VolumeExtractor, NodataIsTheNearestSample) {
  Field<float> field({8, 8, 8}, [](Int3 p) { return p.x < 4 ? -0.1 : 1.0; });
  Volume volume = volume_of(field);
  EXPECT_FALSE(extract(volume, {.isovalue = 0.5}).triangles.empty());
  volume.nodata = -0.1;
  EXPECT_TRUE(extract(volume, {.isovalue = 0.5}).triangles.empty());
}

TYPED_TEST(VolumeOf, OptionsAreThoseOfAStore) {
  const auto field = testing::padded_noise<TypeParam>({50, 40, 36}, 0, 4, 0, 9);
  for (const Inside inside : {Inside::above, Inside::below})
    for (const bool drop : {false, true})
      for (const Topology topology : {Topology::consistent, Topology::trilinear}) {
        const ExtractOptions options{
            .isovalue = 2, .inside = inside, .drop_degenerate = drop, .topology = topology};
        EXPECT_TRUE(same(extract(volume_of(field), options), expected_mesh(field, options)));
      }
}

TEST(VolumeExtractor, LaterIsovaluesAndRegionsUseWhatIsKnown) {
  const auto field = noise_with_calm<float>({150, 97, 70});
  std::atomic<std::uint64_t> read = 0;
  Volume volume = volume_of(field);
  volume.samples = nullptr;
  volume.concurrent_reads = true;
  volume.read = [&, copy = reader_of(field)](Box3 box, void* out) {
    copy(box, out);
    read += static_cast<std::uint64_t>(isobrick::volume(box.extent()));
  };
  VolumeExtractor in_memory(volume_of(field)), by_function(volume);
  Mesh mesh;
  for (const std::optional<Box3> roi :
       {std::optional(Box3{{5, 5, 5}, {60, 50, 40}}), std::optional<Box3>(),
        std::optional(Box3{{0, 0, 30}, {150, 97, 70}})})
    for (const double isovalue : {95.0, 20.5, 42.0}) {
      const ExtractOptions options{.isovalue = isovalue, .roi = roi, .normals = true};
      const testing::Mesh expected = expected_mesh(field, options);
      in_memory.extract(options, mesh);
      EXPECT_TRUE(same(mesh, expected)) << isovalue;
      by_function.extract(options, mesh);
      EXPECT_TRUE(same(mesh, expected)) << isovalue;
    }
  EXPECT_EQ(in_memory.range(), by_function.range());
  ASSERT_TRUE(in_memory.range());
  EXPECT_EQ(in_memory.range()->lo, 0);
  read = 0;
  by_function.extract({.isovalue = 1000}, mesh);
  EXPECT_TRUE(mesh.positions.empty());
  EXPECT_EQ(read, 0u) << "no region has the isovalue";
}

TEST(VolumeExtractor, NothingIsKnownOfARegionsSurroundings) {
  const auto field = noise_with_calm<float>({150, 97, 70});
  VolumeExtractor extractor(volume_of(field));
  Mesh mesh;
  extractor.extract({.isovalue = 42, .roi = Box3{{0, 0, 0}, {20, 20, 20}}}, mesh);
  EXPECT_FALSE(extractor.range());
}

TEST(VolumeExtractor, SinksGetTheMesh) {
  const auto field = noise_with_calm<std::uint16_t>({75, 50, 67});
  const ExtractOptions options{.isovalue = 42, .normals = true};
  const testing::Mesh expected = expected_mesh(field, options);
  Mesh collected;
  MemorySink memory(collected);
  const SurfaceReport report = extract(volume_of(field), options, memory);
  EXPECT_TRUE(same(collected, expected));
  EXPECT_EQ(report.triangles, expected.triangles.size());
  EXPECT_EQ(memory.bytes(), 24 * expected.positions.size() + 12 * expected.triangles.size());
  // In several chunks.
  testing::Mesh joined;
  std::uint64_t chunks = 0;
  const auto append = [](auto& to, const auto& from) {
    to.insert(to.end(), from.begin(), from.end());
  };
  FunctionSink function([&](const MeshChunk& chunk) {
    EXPECT_EQ(chunk.first_vertex, joined.positions.size());
    append(joined.positions, chunk.positions);
    append(joined.normals, chunk.normals);
    append(joined.triangles, chunk.triangles);
    ++chunks;
  });
  ExtractOptions small = options;
  small.memory = std::uint64_t{11} << 20;
  extract(volume_of(field), small, function);
  EXPECT_EQ(joined, expected);
  EXPECT_GT(chunks, 1u);
}

/// Joins chunks that number their own vertices.
class LocalSink final : public MeshSink {
 public:
  Indexing indexing() const override { return Indexing::chunk_local; }
  void begin(const MeshHeader&) override {}
  void write(const MeshChunk& chunk) override {
    for (const Triangle& t : chunk.triangles) {
      for (const std::uint32_t corner : t) {
        ASSERT_LT(corner, chunk.positions.size());
        corners.push_back(chunk.positions[corner]);
      }
    }
    ++chunks;
  }
  void finish() override {}
  std::uint64_t bytes() const override { return 0; }

  std::vector<Vec3f> corners;
  std::uint64_t chunks = 0;
};

TEST(VolumeExtractor, ChunksThatStandAloneHaveTheSameTriangles) {
  const auto field = noise_with_calm<float>({75, 50, 67});
  ExtractOptions options{.isovalue = 42};
  const testing::Mesh expected = expected_mesh(field, options);
  options.memory = std::uint64_t{11} << 20;
  LocalSink sink;
  extract(volume_of(field), options, sink);
  EXPECT_GT(sink.chunks, 1u);
  std::vector<Vec3f> corners;
  for (const Triangle& t : expected.triangles)
    for (const std::uint32_t corner : t) corners.push_back(expected.positions[corner]);
  EXPECT_EQ(sink.corners, corners);
}

void expect_same_header(const MeshHeader& header, const MeshHeader& expected) {
  EXPECT_EQ(header.has_normals, expected.has_normals);
  EXPECT_EQ(header.world_lo, expected.world_lo);
  EXPECT_EQ(header.world_hi, expected.world_hi);
  EXPECT_EQ(header.unit, expected.unit);
  ASSERT_TRUE(header.surface && expected.surface);
  EXPECT_EQ(header.surface->lo, expected.surface->lo);
  EXPECT_EQ(header.surface->hi, expected.surface->hi);
}

TEST(VolumeExtractor, GivesWhatAStoreOfTheSameSamplesGives) {
  const auto field = noise_with_calm<std::int16_t>({75, 50, 67});
  test::MemorySource source(field.extent, ScalarType::i16, test::as_bytes(field.samples));
  Transform& transform = source.mutable_info().transform;
  transform.spacing = {0.5, 1, 2};
  transform.origin = {-3, 8, 1e3};
  transform.direction = {0, -1, 0, 1, 0, 0, 0, 0, 1};
  transform.unit = "micrometer";
  const test::TemporaryFolder folder;
  test::convert_quietly(source, folder / "s.zarr", {});
  const StoreReader store(folder / "s.zarr");
  Volume volume = volume_of(field);
  volume.transform = transform;
  VolumeExtractor by_source(source);
  for (const std::optional<Box3> roi :
       {std::optional<Box3>(), std::optional(Box3{{40, 3, 20}, {75, 47, 60}})}) {
    const ExtractOptions options{.isovalue = 42, .roi = roi, .normals = true};
    const Mesh expected = extract(store, options);
    const testing::Mesh arrays{{expected.positions.begin(), expected.positions.end()},
                               {expected.normals.begin(), expected.normals.end()},
                               {expected.triangles.begin(), expected.triangles.end()},
                               0};
    ASSERT_FALSE(expected.triangles.empty());
    Mesh mesh = extract(volume, options);
    EXPECT_TRUE(same(mesh, arrays));
    EXPECT_EQ(mesh.unit, expected.unit);
    by_source.extract(options, mesh);
    EXPECT_TRUE(same(mesh, arrays));
    HeaderSink of_store, of_volume;
    extract(store, options, of_store);
    extract(volume, options, of_volume);
    expect_same_header(of_volume.header_, of_store.header_);
  }
}

TEST(VolumeExtractor, StreamsThatPassOnceAreRefused) {
  auto source = test::make_source<float>({8, 8, 8}, 1, false, false);
  EXPECT_THROW(VolumeExtractor{source}, UsageError);
}

/// Counts what is taken of it and not given back.
class CountingMemory final : public std::pmr::memory_resource {
 public:
  std::size_t held = 0, allocations = 0;

 private:
  void* do_allocate(std::size_t bytes, std::size_t alignment) override {
    held += bytes;
    ++allocations;
    return std::pmr::new_delete_resource()->allocate(bytes, alignment);
  }
  void do_deallocate(void* memory, std::size_t bytes, std::size_t alignment) override {
    held -= bytes;
    std::pmr::new_delete_resource()->deallocate(memory, bytes, alignment);
  }
  bool do_is_equal(const memory_resource& other) const noexcept override { return this == &other; }
};

TEST(VolumeExtractor, MeshesLieInTheCallersMemory) {
  const auto field = noise_with_calm<float>({75, 50, 67});
  const ExtractOptions options{.isovalue = 42, .normals = true};
  const testing::Mesh expected = expected_mesh(field, options);
  CountingMemory memory;
  {
    Mesh mesh(&memory);
    VolumeExtractor extractor(volume_of(field));
    extractor.extract(options, mesh);
    EXPECT_TRUE(same(mesh, expected));
    EXPECT_GE(memory.held, 24 * expected.positions.size() + 12 * expected.triangles.size());
    const std::size_t allocations = memory.allocations;
    extractor.extract(options, mesh);
    EXPECT_EQ(memory.allocations, allocations) << "the second mesh fits the memory of the first";
  }
  EXPECT_EQ(memory.held, 0u);
}

/// Requests a stop when the extraction begins to report.
class StoppingProgress final : public Progress {
 public:
  explicit StoppingProgress(std::stop_source& stop) : stop_(stop) {}
  void begin(std::string_view stage, std::uint64_t) override {
    if (stage == "extracting") stop_.request_stop();
  }
  void advance(std::uint64_t) override {}
  void end() override {}

 private:
  std::stop_source& stop_;
};

TEST(VolumeExtractor, FailuresLeaveTheMeshItsMemory) {
  const auto field = noise_with_calm<float>({75, 50, 67});
  const ExtractOptions options{.isovalue = 42, .normals = true};
  const testing::Mesh expected = expected_mesh(field, options);
  bool fails = false;
  Volume by_function = volume_of(field);
  by_function.samples = nullptr;
  by_function.read = [&, copy = reader_of(field)](Box3 box, void* out) {
    if (fails) throw std::runtime_error("the simulation has stopped");
    copy(box, out);
  };
  CountingMemory memory;
  Mesh mesh(&memory);
  const auto expect_empty_with = [&](std::size_t capacity) {
    EXPECT_TRUE(mesh.positions.empty() && mesh.normals.empty() && mesh.triangles.empty());
    for (const std::pmr::memory_resource* own :
         {mesh.positions.memory(), mesh.normals.memory(), mesh.triangles.memory()})
      EXPECT_EQ(own, &memory);
    EXPECT_EQ(mesh.positions.capacity(), capacity);
  };
  for (const bool in_memory : {true, false}) {
    VolumeExtractor extractor(in_memory ? volume_of(field) : by_function);
    extractor.extract(options, mesh);
    EXPECT_TRUE(same(mesh, expected));
    const std::size_t capacity = mesh.positions.capacity();
    std::stop_source stop;
    StoppingProgress progress(stop);
    ExtractOptions cancelled = options;
    cancelled.cancel = stop.get_token();
    EXPECT_THROW(extractor.extract(cancelled, mesh, progress), Cancelled);
    expect_empty_with(capacity);
    if (!in_memory) {
      fails = true;
      EXPECT_THROW(extractor.extract(options, mesh), std::runtime_error);
      expect_empty_with(capacity);
      fails = false;
    }
    extractor.extract(options, mesh);
    EXPECT_TRUE(same(mesh, expected));
    EXPECT_EQ(mesh.positions.capacity(), capacity);
  }
}

// The room that is made before is that of a mesh that has none yet.
TEST(VolumeExtractor, ArraysThatWereUsedAreNotMadeLargerThanNeeded) {
  const auto field = noise_with_calm<float>({75, 50, 67});
  const ExtractOptions options{.isovalue = 42};
  const testing::Mesh expected = expected_mesh(field, options);
  Mesh mesh;
  mesh.positions.reserve(expected.positions.size());
  mesh.triangles.reserve(expected.triangles.size());
  extract(volume_of(field), options);
  VolumeExtractor(volume_of(field)).extract(options, mesh);
  EXPECT_TRUE(same(mesh, expected));
  EXPECT_EQ(mesh.positions.capacity(), expected.positions.size());
  EXPECT_EQ(mesh.triangles.capacity(), expected.triangles.size());
}

#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
/// Ends the program with 0 when a mesh is made though the system refuses the room for a far larger
/// one. Each block has a bright sample.
[[noreturn]] void extract_with_few_addresses() {
  const Field<std::uint8_t> field({384, 384, 384}, [](Int3 p) {
    return p.x % 16 == 8 && p.y % 16 == 8 && p.z % 16 == 8 ? 200 : 0;
  });
  std::size_t pages = 0;
  std::ifstream("/proc/self/statm") >> pages;
  const rlim_t bytes = pages * static_cast<rlim_t>(sysconf(_SC_PAGESIZE)) + (rlim_t{96} << 20);
  const rlimit limit{bytes, bytes};
  if (setrlimit(RLIMIT_AS, &limit) != 0) std::exit(2);
  const Mesh mesh = extract(volume_of(field), {.isovalue = 100, .threads = 1});
  std::exit(mesh.triangles.size() == std::size_t{24 * 24 * 24} * 8 ? 0 : 1);
}

TEST(VolumeExtractorDeathTest, RoomForTheMeshIsAHint) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  EXPECT_EXIT(extract_with_few_addresses(), ::testing::ExitedWithCode(0), "");
}
#endif

TEST(VolumeExtractor, LargeMeshesGrowWithoutLosingWhatTheyHold) {
  const auto field = testing::padded_noise<std::uint8_t>({190, 190, 190}, 0, 200, 0, 5);
  const ExtractOptions options{.isovalue = 100};
  const Mesh mesh = extract(volume_of(field), options);
  ASSERT_GT(mesh.triangles.capacity() * sizeof(Triangle), std::size_t{64} << 20);
  EXPECT_TRUE(same(mesh, expected_mesh(field, options)));
}

template <class F>
std::string refusal(F&& f) {
  try {
    f();
  } catch (const UsageError& e) {
    return e.what();
  }
  return "no refusal";
}

TEST(VolumeExtractor, RefusesWhatMakesNoSense) {
  const auto field = noise_with_calm<float>({20, 20, 20});
  const auto with = [&](const std::function<void(Volume&, ExtractOptions&)>& change) {
    Volume volume = volume_of(field);
    ExtractOptions options{.isovalue = 42};
    change(volume, options);
    return refusal([&] { extract(volume, options); });
  };
  EXPECT_EQ(with([](Volume& v, ExtractOptions&) { v.samples = nullptr; }),
            "the volume has neither samples nor a function that reads them");
  EXPECT_NE(with([](Volume& v, ExtractOptions&) { v.extent.y = 0; }).find("20×0×20"),
            std::string::npos);
  EXPECT_NE(with([](Volume& v, ExtractOptions&) {
              v.extent = Int3{1, 1, 1} * (Index{1} << 40);
            }).find("more than 64 bits"),
            std::string::npos);
  EXPECT_EQ(with([](Volume& v, ExtractOptions&) {
              v.strides = {4, 0, 80};
            }),
            "the stride of the samples along y is 0");
  EXPECT_NE(with([](Volume& v, ExtractOptions&) {
              v.extent = {1, (Index{1} << 26) + 1, 1};
            }).find("more than 67108864 along an axis"),
            std::string::npos);
  const std::string misfit = with([](Volume& v, ExtractOptions&) { v.transform.spacing.y = 0; });
  EXPECT_NE(misfit.find("the spacing or origin of the volume does not fit"), std::string::npos);
  EXPECT_EQ(misfit.find("--"), std::string::npos) << "a library has no options";
  EXPECT_EQ(with([](Volume&, ExtractOptions& o) { o.isovalue = NAN; }),
            "the isovalue is not a number");
  EXPECT_EQ(with([](Volume&, ExtractOptions& o) { o.level = 1; }),
            "a volume without a store has no level 1");
  EXPECT_NE(with([](Volume&, ExtractOptions& o) {
              o.roi = Box3{{0, 0, 0}, {21, 3, 3}};
            }).find("leaves the level's 20×20×20 samples"),
            std::string::npos);
  EXPECT_NE(with([](Volume&, ExtractOptions& o) { o.memory = 1 << 16; }).find("too small"),
            std::string::npos);
}

/// A small volume that says that its source takes much.
class HungrySource final : public test::MemorySource {
 public:
  using MemorySource::MemorySource;
  std::size_t memory() const override { return std::size_t{100} << 20; }
};

TEST(VolumeExtractor, BudgetsCountWhatOthersTake) {
  const auto field = noise_with_calm<float>({20, 20, 20});
  HungrySource source(field.extent, ScalarType::f32, test::as_bytes(field.samples));
  Mesh mesh;
  const auto extract_with = [&](std::uint64_t mib, std::uint64_t others) {
    VolumeExtractor(source).extract(
        {.isovalue = 42, .memory = mib << 20, .memory_of_others = others << 20, .threads = 1},
        mesh);
  };
  EXPECT_NE(refusal([&] { extract_with(99, 0); }).find("at least 101 MiB"), std::string::npos);
  EXPECT_NO_THROW(extract_with(101, 0));
  const std::string both = refusal([&] { extract_with(130, 30); });
  EXPECT_NE(both.find("a memory budget of 130.0 MiB"), std::string::npos) << both;
  EXPECT_NE(both.find("at least 131 MiB"), std::string::npos) << both;
  EXPECT_NO_THROW(extract_with(131, 30));
}

// Nothing that grows with the volume is made before the budget is known.
TEST(VolumeExtractor, RangesComeAfterTheBudget) {
  Volume volume;
  volume.extent = Int3{1, 1, 1} * (Index{1} << 18);
  volume.type = ScalarType::u8;
  volume.read = [](Box3, void*) { FAIL(); };
  EXPECT_NE(refusal([&] { extract(volume, {.isovalue = 1}); }).find("too small"),
            std::string::npos);
}

// Along an axis of one tile nothing waits: 94 × 94 × 1 tiles.
TEST(VolumeExtractor, FlatVolumesNeedLittle) {
  Volume volume;
  volume.extent = {3000, 3000, 2};
  volume.type = ScalarType::u8;
  volume.read = [](Box3 box, void* out) {
    std::memset(out, 0, static_cast<std::size_t>(isobrick::volume(box.extent())));
  };
  Mesh mesh;
  VolumeExtractor(volume).extract(
      {.isovalue = 1, .drop_degenerate = true, .memory = std::uint64_t{40} << 20}, mesh);
  EXPECT_TRUE(mesh.positions.empty());
}

TEST(VolumeExtractor, ErrorsOfTheFunctionAndCancellingEndIt) {
  Volume volume;
  volume.extent = {200, 200, 200};
  volume.type = ScalarType::u8;
  int reads = 0;
  volume.read = [&](Box3 box, void* out) {
    if (++reads == 3) throw std::runtime_error("the simulation has stopped");
    std::memset(out, 0, static_cast<std::size_t>(isobrick::volume(box.extent())));
  };
  EXPECT_THROW(extract(volume, {.isovalue = 1}), std::runtime_error);
  std::stop_source stop;
  volume.read = [&](Box3 box, void* out) {
    if (++reads > 4) stop.request_stop();
    std::memset(out, 0, static_cast<std::size_t>(isobrick::volume(box.extent())));
  };
  EXPECT_THROW(extract(volume, {.isovalue = 1, .cancel = stop.get_token()}), Cancelled);
  EXPECT_LE(reads, 8);
}

/// So that a stop waits for no more than a part of the work.
TEST(VolumeExtractorOf, OneThreadReportsAfterEveryFewTiles) {
  const std::vector<std::uint8_t> samples = [] {
    std::vector<std::uint8_t> s(200 * 200 * 200);
    for (std::size_t i = 0; i < s.size(); ++i) s[i] = static_cast<std::uint8_t>(i * 37 % 251);
    return s;
  }();
  struct Counter final : Progress {
    int reports = 0;
    void begin(std::string_view, std::uint64_t) override { reports = 0; }
    void advance(std::uint64_t) override { ++reports; }
    void end() override {}
  } progress;
  extract(Volume::of(samples.data(), {200, 200, 200}), {.isovalue = 100, .threads = 1}, progress);
  EXPECT_GE(progress.reports, 3);
}

}  // namespace
}  // namespace isobrick
