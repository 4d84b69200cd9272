#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <numeric>
#include <optional>

#include <isobrick/error.h>
#include "core/morton.h"
#include "gpu/memory/host_memory.h"
#include "gpu/stream/brick_pool.h"
#include "gpu/stream/gpu_extractor.h"
#include "tests/gpu/collecting_sink.h"
#include "tests/gpu/compare.h"

// The streamed mesh is the CPU's, byte for byte, however it is cut into launches.

namespace isobrick::testing {
namespace {

/// How a field is streamed.
struct Way {
  std::uint32_t tiles = 512;           ///< a launch
  std::size_t call = ~std::size_t{0};  ///< tiles a call
  Index brick = 64;
  bool pool = false;  ///< bricks lie on the device
};

/// Bricks in memory that the device reads.
class DeviceBricks final : public BrickLookup {
 public:
  DeviceBricks(const BrickLookup& bricks, const Lattice& lattice)
      : bricks_(bricks),
        lattice_(lattice),
        memory_(gpu::host_memory(
            0, static_cast<std::size_t>(volume(lattice.bricks())) * lattice.brick_bytes())) {
    for_each_point({{0, 0, 0}, lattice.bricks()}, [&](Int3 b) {
      if (const std::byte* from = bricks.find(b))
        std::copy_n(from, lattice.brick_bytes(), place_of(b));
    });
  }
  const std::byte* find(Int3 b) const override { return bricks_.find(b) ? place_of(b) : nullptr; }
  /// Whoever holds it keeps the samples.
  const std::shared_ptr<std::byte>& memory() const { return memory_; }

 private:
  std::byte* place_of(Int3 b) const {
    return memory_.get() +
           static_cast<std::size_t>(linear_index(b, lattice_.bricks())) * lattice_.brick_bytes();
  }
  const BrickLookup& bricks_;
  Lattice lattice_;
  std::shared_ptr<std::byte> memory_;
};

/// Bricks in a pool on the device.
class PooledBricks final : public BrickLookup {
 public:
  PooledBricks(const BrickLookup& bricks, const Lattice& lattice)
      : lattice_(lattice),
        places_(static_cast<std::size_t>(volume(lattice.bricks()))),
        pool_(std::make_shared<gpu::BrickPool>(0, lattice, places_.size(), 2)) {
    int thread = 0;
    for_each_point({{0, 0, 0}, lattice.bricks()}, [&](Int3 b) {
      const std::byte* from = bricks.find(b);
      if (!from) return;
      std::byte*& place = places_[static_cast<std::size_t>(linear_index(b, lattice_.bricks()))];
      place = pool_->take(lattice.brick_bytes());
      std::copy_n(from, lattice.brick_bytes(), pool_->begin(thread));
      pool_->end(thread, place);
      thread = 1 - thread;
    });
  }
  const std::byte* find(Int3 b) const override {
    return places_[static_cast<std::size_t>(linear_index(b, lattice_.bricks()))];
  }
  const std::shared_ptr<gpu::BrickPool>& pool() const { return pool_; }
  gpu::PoolSizes sizes() const { return {places_.size(), 2}; }

 private:
  Lattice lattice_;
  std::vector<std::byte*> places_;
  std::shared_ptr<gpu::BrickPool> pool_;
};

/// Only what the active tiles need may be looked at: other bricks are poison.
class NeededBricks final : public BrickLookup {
 public:
  NeededBricks(const BrickLookup& all, const Lattice& lattice, std::span<const TileWork> tiles,
               Index reach)
      : all_(all), grid_(lattice.bricks()), needed_(static_cast<std::size_t>(volume(grid_))) {
    const Int3 one{1, 1, 1};
    for (const TileWork& work : tiles)
      for_each_needed_box(lattice, work, reach, [&](Box3 box) {
        const Int3 last = box.hi - one, b = lattice.brick;
        for_each_point(
            {{box.lo.x / b.x, box.lo.y / b.y, box.lo.z / b.z},
             Int3{last.x / b.x, last.y / b.y, last.z / b.z} + one},
            [&](Int3 p) { needed_[static_cast<std::size_t>(linear_index(p, grid_))] = 1; });
      });
  }
  const std::byte* find(Int3 b) const override {
    EXPECT_TRUE(needed_[static_cast<std::size_t>(linear_index(b, grid_))]);
    return all_.find(b);
  }

 private:
  const BrickLookup& all_;
  Int3 grid_;
  std::vector<char> needed_;
};

struct Streamed {
  isobrick::Mesh mesh;
  SurfaceReport report;
};

Streamed stream(const Lattice& lattice, const BrickLookup& all, const SurfaceOptions& options,
                std::span<const TileWork> tiles, const Way& way) {
  Streamed result;
  const DeviceBricks in_host_memory(all, lattice);
  std::optional<PooledBricks> pooled;
  if (way.pool) pooled.emplace(all, lattice);
  const BrickLookup& on_device = pooled ? static_cast<const BrickLookup&>(*pooled) : in_host_memory;
  std::vector<TileWork> looked_at(tiles.begin(), tiles.end());
  if (options.may_have_nan)
    for (TileWork& tile : looked_at) tile.active_blocks = 0xff;
  const NeededBricks bricks(on_device, lattice, looked_at, sample_reach(options));
  CollectingSink sink(options.indexing);
  const gpu::StreamSizes sizes = gpu::stream_sizes(lattice, options, way.tiles, gpu::kMinInFlight,
                                                   pooled ? pooled->sizes() : gpu::PoolSizes{});
  gpu::GpuExtractor extractor(0, lattice, options, sizes, sink, pooled ? pooled->pool() : nullptr);
  for (std::size_t i = 0; i < tiles.size(); i += std::min(way.call, tiles.size()))
    extractor.extract(tiles.subspan(i, std::min(way.call, tiles.size() - i)), bricks,
                      in_host_memory.memory());
  extractor.finish();
  EXPECT_EQ(in_host_memory.memory().use_count(), 1) << "samples are let go";
  result.mesh = std::move(sink.mesh);
  result.report = extractor.report();
  return result;
}

template <class T>
void compare(const Field<T>& field, double isovalue, SurfaceOptions options,
             const std::vector<Way>& ways) {
  options.isovalue = isovalue;
  if (options.roi == Box3{}) options.roi = {{0, 0, 0}, field.extent};
  for (const bool normals : {false, true}) {
    options.normals = normals;
    std::optional<isobrick::Mesh> expected;
    for (const Way& way : ways) {
      SCOPED_TRACE("launches of " + std::to_string(way.tiles) + ", bricks of " +
                   std::to_string(way.brick) + (normals ? ", normals" : ""));
      const Lattice lattice{field.extent, {way.brick, way.brick, way.brick}, scalar_type_of<T>};
      const DenseBricks all(lattice, field.samples.data());
      if (!expected) expected = on_cpu(field, lattice, all, options);
      const std::vector<TileWork> tiles = tiles_of(field, options);
      const Streamed made = stream(lattice, all, options, tiles, way);
      expect_same(*expected, made.mesh);
      EXPECT_EQ(made.report.vertices, expected->positions.size());
      EXPECT_EQ(made.report.triangles, expected->triangles.size());
      EXPECT_EQ(made.report.degenerate_triangles, left_out_on_cpu(field, lattice, all, options));
      if (::testing::Test::HasFailure()) return;
    }
  }
}

/// Some tiles along each axis, the last ones cut; few, since compute-sanitizer takes long.
constexpr Int3 kOdd{67, 41, 97};

const std::vector<Way> kManyWays{{512, ~std::size_t{0}, 64},
                                 {1, ~std::size_t{0}, 16},
                                 {3, 4, 48},
                                 {8, ~std::size_t{0}, 20},
                                 {20, 7, 32},
                                 {4, 6, 48, true}};

template <class T>
class GpuStream : public DeviceTest<T> {};
TYPED_TEST_SUITE(GpuStream, DeviceTypes);

TYPED_TEST(GpuStream, SmoothFieldHoweverItIsCut) {
  compare(this->waves(kOdd), this->lowest() + 100.5, {}, kManyWays);
  compare(this->waves(kOdd), this->lowest() + 140, {}, {{5, 3, 64}});
}

/// One surface of several.
struct Beside {
  SurfaceOptions options;
  std::vector<TileWork> tiles;
  std::unique_ptr<CollectingSink> sink;
  std::unique_ptr<gpu::GpuExtractor> extractor;
};

/// The next tiles of a surface whose codes are below `end`.
std::span<const TileWork> take_tiles(std::span<const TileWork>& left, std::uint64_t end) {
  std::size_t count = 0;
  while (count < left.size() && morton_encode(left[count].tile) < end) ++count;
  const auto taken = left.first(count);
  left = left.subspan(count);
  return taken;
}

/// As in a pass over a store: batch after batch, each surface's tiles of it in turn, from bricks
/// that all of them read.
TYPED_TEST(GpuStream, SeveralSurfacesReadTheSameBricks) {
  const auto field = this->waves(kOdd);
  const Lattice lattice{field.extent, {32, 32, 32}, scalar_type_of<TypeParam>};
  const DenseBricks all(lattice, field.samples.data());
  const double middle = this->lowest() + 100.5;
  for (const bool pool : {false, true}) {
    SCOPED_TRACE(pool ? "pool" : "host memory");
    const DeviceBricks in_host_memory(all, lattice);
    std::optional<PooledBricks> pooled;
    if (pool) pooled.emplace(all, lattice);
    const BrickLookup& bricks = pooled ? static_cast<const BrickLookup&>(*pooled) : in_host_memory;
    std::vector<Beside> surfaces(3);
    surfaces[0].options = {.isovalue = middle, .normals = true};
    surfaces[1].options = surfaces[0].options;
    surfaces[1].options.indexing = Indexing::chunk_local;
    surfaces[2].options = {.isovalue = middle + 20};
    for (Beside& s : surfaces) {
      s.options.roi = lattice.box();
      s.tiles = active_tiles(field, s.options.isovalue);
      s.sink = std::make_unique<CollectingSink>(s.options.indexing);
      s.extractor = std::make_unique<gpu::GpuExtractor>(
          0, lattice, s.options,
          gpu::stream_sizes(lattice, s.options, 4, gpu::kMinInFlight,
                            pooled ? pooled->sizes() : gpu::PoolSizes{}),
          *s.sink, pooled ? pooled->pool() : nullptr);
    }
    std::vector<std::span<const TileWork>> left;
    for (const Beside& s : surfaces) left.emplace_back(s.tiles);
    for (std::uint64_t end = 6; left[0].size() + left[2].size() > 0; end += 6)
      for (std::size_t i = 0; i < surfaces.size(); ++i)
        surfaces[i].extractor->extract(take_tiles(left[i], end), bricks, in_host_memory.memory());
    for (Beside& s : surfaces) s.extractor->finish();
    EXPECT_EQ(in_host_memory.memory().use_count(), 1) << "samples are let go";
    for (const std::size_t i : {0u, 2u})
      expect_same(on_cpu(field, lattice, all, surfaces[i].options), surfaces[i].sink->mesh);
    const isobrick::Mesh &welded = surfaces[0].sink->mesh, &local = surfaces[1].sink->mesh;
    EXPECT_EQ(local.triangles.size(), welded.triangles.size());
    const auto corner = [](const isobrick::Mesh& mesh, std::size_t triangle, std::size_t n) {
      return mesh.positions[mesh.triangles[triangle][n]];
    };
    for (std::size_t i = 0; i < welded.triangles.size(); ++i)
      for (std::size_t n = 0; n < 3; ++n) ASSERT_EQ(corner(local, i, n), corner(welded, i, n));
  }
}

// The mesh of eight tiles of noise is larger than the output of such a launch.
TYPED_TEST(GpuStream, WhatDoesNotFitItsOutputIsMadeInParts) {
  const auto field = this->noise({67, 70, 37}, 1);
  SurfaceOptions options;
  compare(field, this->lowest() + 100, options, {{8, ~std::size_t{0}, 64}, {40, 19, 32}});
  const Lattice lattice{field.extent, {64, 64, 64}, scalar_type_of<TypeParam>};
  const DenseBricks bricks(lattice, field.samples.data());
  options.isovalue = this->lowest() + 100;
  options.roi = lattice.box();
  const Streamed made =
      stream(lattice, bricks, options, active_tiles(field, options.isovalue), {8});
  EXPECT_GT(made.report.repeats, 1u);
}

TYPED_TEST(GpuStream, ExtentsThatFillNoTile) {
  for (const Int3 extent : {Int3{2, 2, 2}, Int3{32, 32, 32}, Int3{34, 5, 3}, Int3{3, 65, 34},
                            Int3{5, 3, 97}, Int3{33, 33, 33}, Int3{48, 49, 17}})
    compare(this->noise(extent, 7), this->lowest() + 100, {}, {{512}, {1, 1, 16}});
}

TYPED_TEST(GpuStream, RegionsOfInterest) {
  for (const Box3 roi : {Box3{{5, 3, 7}, {60, 40, 70}}, Box3{{33, 0, 31}, {66, 39, 75}},
                         Box3{{31, 31, 31}, {34, 34, 34}}, Box3{{40, 2, 40}, {41, 20, 60}}}) {
    SurfaceOptions options;
    options.roi = roi;
    compare(this->noise({67, 41, 75}, 3), this->lowest() + 100, options, {{512}, {2, 3, 20}});
  }
}

TYPED_TEST(GpuStream, DegenerateTrianglesAreLeftOut) {
  SurfaceOptions options;
  options.drop_degenerate = true;
  const double mid = this->lowest() + 100;
  compare(this->coarse(kOdd, 1), mid, options, kManyWays);
  compare(this->waves(kOdd), mid, options, {{5, 3, 64}});
  compare(this->coarse(kOdd, 2), mid + 0.5, options, {{5, 3, 64}, {5, 3, 32}});
  for (unsigned seed = 0; seed < 40; ++seed)
    compare(this->at_a_corner(seed), mid, options, {{1 + seed % 4, 3, 64}});
  options.indexing = Indexing::chunk_local;
  compare(this->coarse(kOdd, 3), mid, options, {{512, ~std::size_t{0}, 64}, {3, 4, 48}});
  options.indexing = Indexing::welded;
  options.roi = {{20, 3, 31}, {66, 40, 90}};
  options.inside = Inside::below;
  compare(this->coarse(kOdd, 4), mid, options, {{5, 3, 64}});
}

TYPED_TEST(GpuStream, TheTrilinearInterpolantIsFollowed) {
  SurfaceOptions options;
  options.topology = Topology::trilinear;
  const double mid = this->lowest() + 100;
  compare(this->noise(kOdd, 1), mid, options, kManyWays);
  compare(this->coarse(kOdd, 1), mid, options, {{5, 3, 64}});
  compare(this->waves(kOdd), mid, options, {{5, 3, 64}});
  options.indexing = Indexing::chunk_local;
  compare(this->noise(kOdd, 3), mid, options, {{512, ~std::size_t{0}, 64}, {3, 4, 48}});
  options.indexing = Indexing::welded;
  options.roi = {{20, 3, 31}, {66, 40, 90}};
  options.inside = Inside::below;
  compare(this->noise(kOdd, 4), mid, options, {{5, 3, 64}});
}

TYPED_TEST(GpuStream, TheBorderIsCapped) {
  SurfaceOptions options;
  options.cap = true;
  const double mid = this->lowest() + 100;
  for (const Inside inside : {Inside::above, Inside::below})
    for (const Topology topology : {Topology::consistent, Topology::trilinear})
      for (const bool drop : {false, true}) {
        options.inside = inside;
        options.topology = topology;
        options.drop_degenerate = drop;
        compare(this->coarse(kOdd, 1), mid, options, {{5, 3, 64}});
        compare(this->waves(kOdd), mid + 0.5, options, {{5, 3, 32}});
      }
  compare(this->coarse(kOdd, 1), mid, options, kManyWays);
  for (unsigned seed = 0; seed < 40; ++seed)
    compare(this->at_a_corner(seed), mid, options, {{1 + seed % 4, 3, 64}});
  options.indexing = Indexing::chunk_local;
  compare(this->coarse(kOdd, 3), mid, options, {{512, ~std::size_t{0}, 64}, {3, 4, 48}});
  options.indexing = Indexing::welded;
  options.roi = {{20, 3, 31}, {66, 40, 90}};
  compare(this->coarse(kOdd, 4), mid, options, {{5, 3, 64}});
}

TYPED_TEST(GpuStream, TheTrilinearInterpolantWithoutDegenerateTriangles) {
  SurfaceOptions options;
  options.topology = Topology::trilinear;
  options.drop_degenerate = true;
  const double mid = this->lowest() + 100;
  compare(this->coarse(kOdd, 1), mid, options, kManyWays);
  options.indexing = Indexing::chunk_local;
  compare(this->coarse(kOdd, 3), mid, options, {{512, ~std::size_t{0}, 64}, {3, 4, 48}});
}

template <class T>
using GpuStreamWithNaN = DeviceTest<T>;

TYPED_TEST_SUITE(GpuStreamWithNaN, TypesWithNaN);

TYPED_TEST(GpuStreamWithNaN, IsTheMeshOfTheCpu) {
  SurfaceOptions options;
  options.may_have_nan = true;
  compare(with_nan(this->waves(kOdd), 1, 300), 0, options, kManyWays);
  compare(with_nan(this->noise({67, 41, 75}, 2), 3, 20), 0, options, kManyWays);
  for (const Int3 extent : {Int3{2, 2, 2}, Int3{33, 33, 33}, Int3{34, 35, 65}})
    compare(with_nan(this->noise(extent, 4), 5, 8), 0, options, {{512}, {1, 1, 16}});
  options.roi = {{31, 2, 30}, {66, 39, 75}};
  compare(with_nan(this->noise({67, 41, 75}, 2), 6, 20), 0, options, {{512}, {2, 3, 20}});
  options.cap = true;
  compare(with_nan(this->noise({67, 41, 75}, 2), 6, 300), 0, options, {{512}, {2, 3, 20}});
  options.cap = false;
  options.indexing = Indexing::chunk_local;
  compare(with_nan(this->noise({67, 41, 75}, 2), 6, 20), 0, options, {{512}, {8, 5, 20}});
}

TYPED_TEST(GpuStream, EveryTileAloneForFormatsWithoutSharing) {
  SurfaceOptions options;
  options.indexing = Indexing::chunk_local;
  compare(this->waves(kOdd), this->lowest() + 100.5, options, kManyWays);
  compare(this->noise({67, 41, 75}, 3), this->lowest() + 100, options, {{512}, {8, 5, 20}});
}

TYPED_TEST(GpuStream, TransformsTurnAndMirror) {
  SurfaceOptions options;
  options.transform.spacing = {0.7, 1.3, -2};
  options.transform.origin = {-5, 11, 0.25};
  options.transform.direction = {0, -1, 0, 1, 0, 0, 0, 0, 1};
  compare(this->waves({67, 41, 75}), this->lowest() + 100, options, {{512}, {4}});
}

TYPED_TEST(GpuStream, SmallerSamplesInsideTurnTheMeshRound) {
  SurfaceOptions options;
  options.inside = Inside::below;
  for (const bool normals : {false, true}) {
    options.normals = normals;
    compare(this->waves({67, 41, 75}), this->lowest() + 100, options, {{512}, {4}});
  }
}

TYPED_TEST(GpuStream, AbsentBricksAreTheFillValue) {
  using T = TypeParam;
  const HoledField<T> holed(this->waves(kOdd), static_cast<T>(this->lowest() + 30));
  const SurfaceOptions options = holed.options(this->lowest() + 100.5);
  const std::vector<TileWork> tiles = active_tiles(holed.field, options.isovalue);
  const Streamed made = stream(holed.lattice, holed, options, tiles, {16});
  EXPECT_GT(made.report.triangles, 1000u);
  expect_same(on_cpu(holed.field, holed.lattice, holed.bricks, options), made.mesh);
}

TYPED_TEST(GpuStream, TheSinkMayFail) {
  const auto field = this->waves(kOdd);
  const Lattice lattice{field.extent, {64, 64, 64}, scalar_type_of<TypeParam>};
  const DenseBricks all(lattice, field.samples.data());
  const DeviceBricks bricks(all, lattice);
  SurfaceOptions options;
  options.isovalue = this->lowest() + 100;
  options.roi = lattice.box();
  const std::vector<TileWork> tiles = active_tiles(field, options.isovalue);
  FailingSink sink(3);
  gpu::GpuExtractor extractor(0, lattice, options, gpu::stream_sizes(lattice, options, 2), sink);
  EXPECT_THROW(
      {
        extractor.extract(tiles, bricks, bricks.memory());
        extractor.finish();
      },
      Error);
  EXPECT_EQ(sink.taken, 3);
}

TEST(GpuExtractor, WhatIsNoSurfaceIsRefused) {
  if (!gpu::device_available()) GTEST_SKIP() << "no CUDA device";
  const auto refused = [](ScalarType type, auto change) {
    const Lattice lattice{{64, 64, 64}, {64, 64, 64}, type};
    SurfaceOptions options{.roi = lattice.box()};
    change(options);
    CollectingSink sink;
    EXPECT_THROW(
        gpu::GpuExtractor(0, lattice, options, gpu::stream_sizes(lattice, options, 1), sink),
        UsageError);
  };
  refused(ScalarType::u8, [](SurfaceOptions& o) { o.isovalue = std::nan(""); });
  refused(ScalarType::u8, [](SurfaceOptions& o) { o.roi = {{99, 0, 0}, {100, 1, 1}}; });
}

}  // namespace
}  // namespace isobrick::testing
