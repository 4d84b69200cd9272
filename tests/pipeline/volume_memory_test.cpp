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
