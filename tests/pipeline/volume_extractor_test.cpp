#include <isobrick/volume_extractor.h>

#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <cstring>
#include <functional>
#include <stdexcept>

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
                                  .drop_degenerate = options.drop_degenerate});
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
    for (const bool drop : {false, true}) {
      const ExtractOptions options{.isovalue = 2, .inside = inside, .drop_degenerate = drop};
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
  std::uint64_t vertices = 0, triangles = 0, chunks = 0;
  FunctionSink function([&](const MeshChunk& chunk) {
    EXPECT_EQ(chunk.first_vertex, vertices);
    vertices += chunk.positions.size();
    triangles += chunk.triangles.size();
    ++chunks;
  });
  ExtractOptions small = options;
  small.memory = std::uint64_t{11} << 20;
  extract(volume_of(field), small, function);
  EXPECT_EQ(vertices, expected.positions.size());
  EXPECT_EQ(triangles, expected.triangles.size());
  EXPECT_GT(chunks, 1u);
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

}  // namespace
}  // namespace isobrick
