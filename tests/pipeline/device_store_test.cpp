#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include <isobrick/device.h>
#include <isobrick/device_extractor.h>
#include <isobrick/error.h>
#include <isobrick/index_build.h>
#include <isobrick/pieces.h>
#include "index/active_tiles.h"
#include "surface/cpu_extractor.h"
#include "tests/gpu/compare.h"
#include "tests/pipeline/convert_store.h"

// Surfaces of a store whose samples and meshes stay on a device are those of the CPU.

namespace isobrick::test {
namespace {

bool has_device() {
#ifdef ISOBRICK_WITH_CUDA
  return gpu::device_available();
#else
  return false;
#endif
}

isobrick::Mesh on_cpu(const StoreReader& store, ExtractOptions options) {
  options.backend = Backend::cpu;
  options.gpu_memory = 0;
  return extract(store, options);
}

/// A converted volume. Skipped where there is no device.
class DeviceStore : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!has_device()) GTEST_SKIP() << "no CUDA device";
  }

  template <class T>
  std::unique_ptr<StoreReader> convert(Int3 extent, BrickCodec codec, Index brick = 20) {
    MemorySource source = make_source<T>(extent, 7, true);
    const auto path = folder_ / ("store" + std::to_string(stores_++));
    convert_quietly(source, path,
                    {.brick = brick, .shard = 2 * brick, .codec = codec, .threads = 2});
    return std::make_unique<StoreReader>(path);
  }

  /// An isovalue that many bricks have on both sides.
  static double middle(const StoreReader& store) {
    const Box3 bricks{{0, 0, 0}, store.info().levels[0].lattice.bricks()};
    std::vector<double> middles;
    for (const auto& range : store.brick_ranges(0, bricks).ranges)
      if (std::isfinite(range.lo) && std::isfinite(range.hi))
        middles.push_back(range.lo * 0.55 + range.hi * 0.45);
    if (middles.empty()) return 0;
    std::nth_element(middles.begin(), middles.begin() + middles.size() / 2, middles.end());
    return middles[middles.size() / 2];
  }

  TemporaryFolder folder_;

 private:
  int stores_ = 0;
};

template <class T>
class DeviceStoreOf : public DeviceStore {};
TYPED_TEST_SUITE(DeviceStoreOf, testing::DeviceTypes);

TYPED_TEST(DeviceStoreOf, TheMeshIsThatOfTheCpu) {
  for (const BrickCodec codec : {BrickCodec::none, BrickCodec::zstd, BrickCodec::packed})
    for (const Index brick : {20, 32, 64}) {
      const auto opened = this->template convert<TypeParam>({83, 70, 67}, codec, brick);
      const StoreReader& store = *opened;
      const double isovalue = this->middle(store);
      for (const bool normals : {false, true}) {
        const ExtractOptions options{.isovalue = isovalue, .normals = normals, .threads = 3};
        testing::expect_same(on_cpu(store, options), extract_to_device(store, options).download());
      }
    }
}

TYPED_TEST(DeviceStoreOf, AnyNumberOfIsovaluesAndRegionsOfOneReading) {
  const auto opened = this->template convert<TypeParam>({83, 70, 67}, BrickCodec::packed);
  const StoreReader& store = *opened;
  const double middle = this->middle(store);
  DeviceExtractor extractor(store, {.threads = 2});
  for (const double isovalue : {middle, middle * 0.7, middle * 1.2})
    for (const std::optional<Box3>& roi :
         {std::optional<Box3>(), std::optional<Box3>({{10, 3, 31}, {50, 70, 66}})}) {
      const ExtractOptions options{.isovalue = isovalue, .roi = roi, .normals = true};
      testing::expect_same(on_cpu(store, options), extractor.extract(options).download());
    }
}

TYPED_TEST(DeviceStoreOf, DegenerateTrianglesAreLeftOut) {
  const auto opened = this->template convert<TypeParam>({83, 70, 67}, BrickCodec::packed);
  const ExtractOptions options{.isovalue = std::round(this->middle(*opened)),
                               .normals = true,
                               .drop_degenerate = true,
                               .threads = 2};
  testing::expect_same(on_cpu(*opened, options), extract_to_device(*opened, options).download());
}

TYPED_TEST(DeviceStoreOf, TheTrilinearInterpolantIsFollowed) {
  const auto opened = this->template convert<TypeParam>({83, 70, 67}, BrickCodec::packed);
  const ExtractOptions options{.isovalue = this->middle(*opened),
                               .normals = true,
                               .topology = Topology::trilinear,
                               .threads = 2};
  testing::expect_same(on_cpu(*opened, options), extract_to_device(*opened, options).download());
}

TYPED_TEST(DeviceStoreOf, TheBorderIsCapped) {
  const auto opened = this->template convert<TypeParam>({83, 70, 67}, BrickCodec::packed);
  for (const bool both : {false, true}) {
    ExtractOptions options{.isovalue = std::round(this->middle(*opened)),
                           .inside = both ? Inside::below : Inside::above,
                           .normals = true,
                           .drop_degenerate = both,
                           .topology = both ? Topology::trilinear : Topology::consistent,
                           .cap = true,
                           .threads = 2};
    testing::expect_same(on_cpu(*opened, options), extract_to_device(*opened, options).download());
    DeviceExtractor extractor(*opened, options);
    testing::expect_same(on_cpu(*opened, options), extractor.extract(options).download());
  }
}

/// The pieces of a mesh are those of the CPU, and so is the mesh that they become.
TYPED_TEST(DeviceStoreOf, PiecesAreThoseOfTheCpu) {
  const auto opened = this->template convert<TypeParam>({150, 140, 131}, BrickCodec::packed);
  const double isovalue = std::round(this->middle(*opened));
  for (const bool drop : {false, true})
    for (std::uint32_t count : {1u, 3u, 7u})
      for (std::uint32_t number = 1; number <= count; ++number) {
        SCOPED_TRACE(std::to_string(number) + " of " + std::to_string(count));
        ExtractOptions options{.isovalue = isovalue,
                               .normals = number % 2 == 0,
                               .drop_degenerate = drop,
                               .cap = drop,
                               .threads = 2,
                               .backend = Backend::cpu};
        const auto cpu = this->folder_ / "cpu.piece", gpu = this->folder_ / "gpu.piece";
        extract_piece(*opened, options, {number, count}, cpu, true);
        options.backend = Backend::cuda;
        const PieceReport made = extract_piece(*opened, options, {number, count}, gpu, true);
        EXPECT_EQ(made.surface.backend, "cuda");
        EXPECT_TRUE(content_of(cpu) == content_of(gpu));
        std::filesystem::remove(cpu);
        std::filesystem::remove(gpu);
      }
}

TEST_F(DeviceStore, ARegionOfALevel) {
  const auto opened = convert<float>({150, 140, 131}, BrickCodec::packed);
  const StoreReader& store = *opened;
  const Box3 region{{20, 11, 3}, {61, 60, 50}};
  ExtractOptions options{.isovalue = middle(store), .level = 1, .roi = region, .normals = true};
  DeviceExtractor extractor(store, options);
  testing::expect_same(on_cpu(store, options), extractor.extract(options).download());
  options.roi.reset();  // the whole of what was read
  ExtractOptions expected = options;
  expected.roi = region;
  testing::expect_same(on_cpu(store, expected), extractor.extract(options).download());
  options.roi = Box3{{20, 11, 2}, {61, 60, 50}};
  EXPECT_THROW(extractor.extract(options), UsageError) << "was not read";
  options.roi.reset();
  options.level = 0;
  EXPECT_THROW(extractor.extract(options), UsageError) << "is another level";
}

/// Range chunks of 1,024 samples are searched beside each other.
TEST_F(DeviceStore, OfSeveralRangeChunks) {
  for (const Int3 extent : {Int3{1100, 40, 1060}, Int3{2070, 33, 34}}) {
    const auto opened = convert<std::uint8_t>(extent, BrickCodec::packed, 64);
    for (const std::optional<Box3>& roi :
         {std::optional<Box3>(), std::optional<Box3>({{1000, 2, 3}, {1050, 30, 34}}),
          std::optional<Box3>({{1023, 2, 3}, {1025, 30, 34}})}) {
      const ExtractOptions options{.isovalue = middle(*opened), .roi = roi};
      testing::expect_same(on_cpu(*opened, options),
                           extract_to_device(*opened, options).download());
    }
  }
}

TEST_F(DeviceStore, ByAnIndex) {
  const auto opened = convert<std::uint16_t>({150, 140, 131}, BrickCodec::packed);
  const ExtractOptions plain{.isovalue = middle(*opened)};
  const isobrick::Mesh expected = on_cpu(*opened, plain);
  const std::filesystem::path path = opened->storage()->local_path();
  add_index(path, {.kind = IndexKind::octree, .threads = 2});
  const StoreReader indexed(path);
  ExtractOptions options = plain;
  options.index = {.automatic = false, .kind = IndexKind::octree};
  testing::expect_same(expected, extract_to_device(indexed, options).download());
}

TEST_F(DeviceStore, TheStoreIsNotNeededAnyMore) {
  auto store = convert<std::uint16_t>({70, 71, 72}, BrickCodec::zstd);
  const ExtractOptions options{.isovalue = middle(*store)};
  const isobrick::Mesh expected = on_cpu(*store, options);
  DeviceExtractor extractor(*store, {});
  store.reset();
  testing::expect_same(expected, extractor.extract(options).download());
}

TEST_F(DeviceStore, NothingIsActive) {
  const auto opened = convert<std::uint16_t>({70, 71, 72}, BrickCodec::packed);
  const StoreReader& store = *opened;
  EXPECT_TRUE(extract_to_device(store, {.isovalue = 1e9}).triangles().empty());
}

TEST_F(DeviceStore, BudgetsAreKeptOrRefused) {
  const auto opened = convert<float>({150, 140, 131}, BrickCodec::packed);
  const StoreReader& store = *opened;
  ExtractOptions options{.isovalue = middle(store), .threads = 2};
  options.memory = 20 << 20;
  EXPECT_THROW(extract_to_device(store, options), UsageError);
  options.memory = 1 << 30;
  options.gpu_memory = 1 << 20;
  EXPECT_THROW(extract_to_device(store, options), UsageError);
  options.gpu_memory = std::uint64_t{1} << 30;
  testing::expect_same(on_cpu(store, options), extract_to_device(store, options).download());
}

TEST_F(DeviceStore, WhatTheDeviceCannotDoIsRefused) {
  const auto opened = convert<std::uint8_t>({40, 40, 40}, BrickCodec::packed);
  const StoreReader& store = *opened;
  const double isovalue = middle(store);
  for (const ExtractOptions& options :
       {ExtractOptions{.isovalue = isovalue, .level = 9},
        ExtractOptions{.isovalue = std::numeric_limits<double>::quiet_NaN()},
        ExtractOptions{.isovalue = isovalue, .backend = Backend::cpu},
        ExtractOptions{.isovalue = isovalue, .device = 99}})
    EXPECT_THROW(extract_to_device(store, options), UsageError);
}

TEST_F(DeviceStore, AnEndThatIsRequestedEndsIt) {
  const auto opened = convert<std::uint8_t>({90, 80, 70}, BrickCodec::packed);
  const StoreReader& store = *opened;
  std::stop_source stop;
  stop.request_stop();
  EXPECT_THROW(extract_to_device(store, {.isovalue = middle(store), .cancel = stop.get_token()}),
               Cancelled);
}

TEST_F(DeviceStore, DamagedBricksAreNamed) {
  for (const BrickCodec codec : {BrickCodec::zstd, BrickCodec::packed}) {
    const auto opened = convert<std::uint16_t>({70, 71, 72}, codec);
    const StoreReader& store = *opened;
    const auto at = store.locate(0, {1, 1, 1});
    ASSERT_TRUE(at);
    {
      std::fstream file(store.storage()->local_path() / at->key,
                        std::ios::in | std::ios::out | std::ios::binary);
      file.seekp(static_cast<std::streamoff>(at->offset + at->size / 2));
      file.put('\x5a').put('\xa5').put('\x5a');
    }
    try {
      extract_to_device(store, {.isovalue = middle(store)});
      FAIL();
    } catch (const DamageError& error) {
      EXPECT_NE(std::string(error.what()).find("(1, 1, 1)"), std::string::npos) << error.what();
    }
  }
}

TEST(WithoutADevice, AStoreIsRefused) {
  if (has_device()) GTEST_SKIP() << "there is one";
  TemporaryFolder folder;
  MemorySource source = make_source<std::uint8_t>({20, 20, 20}, 3);
  convert_quietly(source, folder / "store", {.threads = 1});
  const StoreReader store(folder / "store");
  EXPECT_THROW(extract_to_device(store, {.isovalue = 100}), Error);
  EXPECT_THROW(DeviceExtractor(store, {}), Error);
}

}  // namespace
}  // namespace isobrick::test
