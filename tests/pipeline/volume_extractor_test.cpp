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
#include "tests/pipeline/volume_fields.h"

namespace isobrick::inline v0 {
namespace {

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

}  // namespace
}  // namespace isobrick
